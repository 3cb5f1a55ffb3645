"""What the data tell at an estimate: derivatives, noise, intervals, directions that stay open."""
