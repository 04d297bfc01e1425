"""Scores of meshes and images against a ground truth, by named protocols."""
