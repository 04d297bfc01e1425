"""Captures on disk to a typed `Scene`: cameras, frames, sparse points."""
