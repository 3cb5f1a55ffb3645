"""Objectives: from an output error to the numbers a search makes small."""
