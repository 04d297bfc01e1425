"""Metashape's exported cameras."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from room2dgs.tools.capture_layouts.made import Made, photo_file, text


def metashape(root: Path, made: Made) -> None:
    """cx, cy from the photo's middle; a component that is turned and moved."""
    root.mkdir(parents=True)
    fx, fy, cx, cy = made.fx_fy_cx_cy
    inner = np.eye(4)
    inner[:3, :3], inner[:3, 3] = Rotation.from_rotvec([0.2, -0.1, 0.3]).as_matrix(), [0.5, 0.1, -0.2]
    cameras = []
    for i, pose in enumerate(made.poses):
        photo_file(root / f"images/IMG_{i + 8}.JPG", made, i)
        own = text(np.linalg.inv(inner) @ pose)
        cameras.append(
            f'<camera id="{i}" sensor_id="0" component_id="0" label="IMG_{i + 8}"><transform>{own}</transform></camera>'
        )
    (root / "cameras.xml").write_text(
        '<?xml version="1.0" encoding="UTF-8"?>\n<document version="2.0.0"><chunk label="Chunk 1"><sensors>'
        f'<sensor id="0" label="x" type="frame"><resolution width="{made.width}" height="{made.height}"/>'
        f'<calibration type="frame" class="adjusted"><resolution width="{made.width}" height="{made.height}"/>'
        f"<f>{fy}</f><b1>{fx - fy}</b1><cx>{cx - made.width / 2}</cx><cy>{cy - made.height / 2}</cy>"
        "</calibration></sensor>"
        f'</sensors><components><component id="0"><transform><rotation>{text(inner[:3, :3])}</rotation>'
        f"<translation>{text(2 * inner[:3, 3])}</translation><scale>2</scale></transform></component></components>"
        f"<cameras>{''.join(cameras)}</cameras></chunk></document>"
    )
