"""All depth maps optimised together until views, points and normals agree."""
