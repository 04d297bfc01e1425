"""The capture's own depth camera as a depth prior: used as it is, with an expected error for each pixel."""
