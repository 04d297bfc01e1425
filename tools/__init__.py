"""Capture-side programs: what makes or converts captures before room2dgs reads them."""
