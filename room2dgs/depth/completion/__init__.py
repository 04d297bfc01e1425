"""Completion: each view's joint depth, drawn to what stereo found, and how far the result is to be trusted."""
