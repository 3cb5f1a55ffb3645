"""A new project: arm file, model, settings of a fit and a picture, from a robot's file and logs."""

from hydroid.project.project import Project, write_project

__all__ = ["Project", "write_project"]
