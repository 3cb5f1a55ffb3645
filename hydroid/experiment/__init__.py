"""The next experiment: the one that tells most about what is known least."""
