"""A new project: arm file, model, settings of a fit and a picture, from a robot's file
and logs."""
