"""A robot's URDF or MJCF and meshes -> the model of a serial arm, through MuJoCo's importer."""

from hydroid.cad.importer import ImportedArm, import_arm

__all__ = ["ImportedArm", "import_arm"]
