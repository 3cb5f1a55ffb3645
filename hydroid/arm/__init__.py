"""The arm: meshes and settings -> MJCF, its cylinders' geometry,
and the smallest model that moves alike."""
