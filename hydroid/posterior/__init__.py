"""What the logs say about an estimate: derivatives, noise, covariance, intervals, quantities, bands."""
