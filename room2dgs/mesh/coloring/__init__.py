"""Colours of a surface, from the photos that see it best."""
