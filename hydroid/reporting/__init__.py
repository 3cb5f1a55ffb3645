"""What a user sees of a fit: tables, figures, one page. Units are those of a reader:
deg, not rad."""
