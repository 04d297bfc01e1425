"""Imports pycolmap without giving it SIGTERM, so that a run that is told to end ends as after Ctrl-C."""

from room2dgs.interrupts import sigterm_kept

with sigterm_kept():
    import pycolmap

__all__ = ["ONE_THREAD", "pycolmap"]

# Residuals of a bundle adjustment from which on Ceres sums on several threads, in an order that depends on them: never.
ONE_THREAD = 2**31 - 1
