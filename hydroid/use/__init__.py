"""What an identified arm is for: commands along a path, draws, an environment, files of
other programs."""
