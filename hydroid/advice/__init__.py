"""What to change next: missing terms, residuals, actions, and the next experiment."""
