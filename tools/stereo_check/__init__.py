"""Dense stereo where depth is known: how much of it is found and right, and how fast."""
