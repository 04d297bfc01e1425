"""pycolmap, imported without giving it SIGTERM: a run that is told to end has to end as after Ctrl-C."""

from room2dgs.interrupts import sigterm_kept

with sigterm_kept():
    import pycolmap

__all__ = ["pycolmap"]
