"""A fit: search, refinement, what the estimate is worth; and how it does on logs it has
not seen."""
