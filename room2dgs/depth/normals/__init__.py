"""Conventions of normal maps, checked and brought to the house."""
