"""A robot's URDF or MJCF and meshes -> links and joints of a serial arm, through MuJoCo's importer."""

from hydroid.cad.imported import ImportedArm, ImportedJoint, ImportedLink
from hydroid.cad.importer import import_arm

__all__ = ["ImportedArm", "ImportedJoint", "ImportedLink", "import_arm"]
