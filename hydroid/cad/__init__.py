"""A robot's URDF or MJCF and meshes -> the model of a serial arm, through MuJoCo's
importer."""
