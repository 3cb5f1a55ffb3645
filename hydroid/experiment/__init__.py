"""The next experiment: its commands, what it would measure, and how precisely."""
