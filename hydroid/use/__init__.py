"""What an identified arm is for: commands that follow a path, draws, an environment, other programs' files."""
