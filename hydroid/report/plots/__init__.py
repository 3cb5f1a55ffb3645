"""Figures of reports. Each function returns a matplotlib `Figure`; `style.rendered` makes files of it."""
