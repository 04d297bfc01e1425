"""Randomised rooms with exact geometry, to train the depth and normal network on."""
