"""Rendered depth to a cleaned, coloured triangle mesh."""
