"""To look at without fitting anything: an actuator's curves, and the arm in motion under its hydraulics."""
