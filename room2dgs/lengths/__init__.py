"""Lengths of a room with their standard deviations: of surfaces, planes, and the scale that all of them share."""
