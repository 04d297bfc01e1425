"""Planes of a room, by name, and its floor plan."""
