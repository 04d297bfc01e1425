"""Exposure and white balance of photos, from the colours of places that several of them see."""
