"""A mesh with a picture on it, baked from the photos."""
