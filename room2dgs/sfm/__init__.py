"""Which photos to match, and the sparse points that they give."""
