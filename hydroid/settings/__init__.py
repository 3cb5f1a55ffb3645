"""Settings: one module per subject, all read through `load`."""
