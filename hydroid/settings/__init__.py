"""Settings: one file a noun, all read through `load`."""
