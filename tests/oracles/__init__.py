"""Slow, plain versions of what the package does fast, which tests compare it with."""
