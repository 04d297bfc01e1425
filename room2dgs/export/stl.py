"""STL: triangles and nothing else, for CAD and printing. Binary, with z up, metres; its header says so."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh
from trimesh.exchange.stl import export_stl

from room2dgs import __version__
from room2dgs.export.local_files import write_local
from room2dgs.export.mesh_files import turned_mesh
from room2dgs.export.source import Source

HEADER = 80  # bytes


def write_stl(source: Source, path: Path) -> list[Path]:
    """See `stl`; with few faces where the settings want few."""
    return write_local(source, path, stl(source.hand_over, source.z_up), source.z_up)


def stl(mesh: trimesh.Trimesh, rotation: np.ndarray) -> bytes:
    """A whole file. The format has no field for a unit: most programs take the numbers for millimetres.

    Args:
        rotation: (3, 3) from the world to a frame with z up.
    """
    said = f"room2dgs {__version__}, unit: metre, z up".encode("ascii", "replace")  # "solid" would begin a text file
    return said[:HEADER].ljust(HEADER, b"\0") + export_stl(turned_mesh(mesh, rotation))[HEADER:]
