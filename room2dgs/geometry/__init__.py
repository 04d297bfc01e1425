"""Cameras, rotations, depth maps, normals, homographies, spherical harmonics: each once."""
