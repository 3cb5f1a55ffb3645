"""What to change next: terms that the model lacks, what the residual shows, what would determine more."""
