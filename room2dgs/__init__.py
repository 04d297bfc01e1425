"""room2dgs: posed photos of a room to a metric triangle mesh, with 2D Gaussian surfels."""

from __future__ import annotations

import os
import sys

# libgomp's workers spin after every parallel region of torch; on few cores that starves the
# rasterizer's own threads (up to tenfold). It reads this once, when torch is first imported.
if "torch" not in sys.modules:
    os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")

__version__ = "0.1.0"
