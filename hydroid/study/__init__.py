"""Studies: what varies, over which seeds, on which data; their runs; what is measured and claimed of them."""
