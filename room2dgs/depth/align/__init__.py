"""Depth maps aligned to the sparse points, view by view."""
