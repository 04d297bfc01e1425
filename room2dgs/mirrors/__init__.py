"""Mirrors: what views measure behind the glass is the room once more, and is left out of mesh and plan."""
