"""Searches: from objectives to better points of the unit box. Nothing here knows what is searched for."""
