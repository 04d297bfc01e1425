"""Densification and pruning."""
