"""What the logs say about an estimate: errors and their likelihood, covariance,
quantities, bands."""
