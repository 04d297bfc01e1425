"""One file for each layout of a capture on disk."""
