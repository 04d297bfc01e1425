"""Gaussians as PLY, in the order of properties that 3DGS and 2DGS write, and in two forms.

With a third scale every splat viewer draws the discs, as Gaussians that are next to flat. Without it the file says
that they are discs: 2DGS tools read it, others refuse it or show points.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from torch import Tensor

from room2dgs.export.local_files import write_local
from room2dgs.export.source import Source
from room2dgs.primitives.primitive import Splats, mapped
from room2dgs.primitives.registry import primitive_of

OPACITY_ENDS = 1e-6  # its logit is finite


def write_splats(source: Source, path: Path) -> list[Path]:
    """As Gaussians, for every viewer."""
    data = gaussian_ply(source.surfels_y_down, comments=source.comments(source.y_down))
    return write_local(source, path, data, source.y_down)


def write_splats_2dgs(source: Source, path: Path) -> list[Path]:
    """As discs, for 2DGS tools."""
    comments = ["SplatRenderMode: 2dgs", *source.comments(source.y_down)]
    discs = primitive_of(source.surfels).as_discs(source.surfels_y_down)
    return write_local(source, path, gaussian_ply(discs, False, comments), source.y_down)


def gaussian_ply(
    splats: Splats, third_scale: bool = True, comments: Sequence[str] = (), sh_degree: int | None = None
) -> bytes:
    """A whole file, binary little endian.

    Args:
        third_scale: write scale_2 of what has two scales, too (`Primitive.three_scales`).
        comments: lines of the header.
        sh_degree: pad the harmonics with zeros to this degree, where they are of a lower one; some loaders want 3.
    """
    table = columns(splats, third_scale, sh_degree)
    header = ["ply", "format binary_little_endian 1.0", *(f"comment {line}" for line in comments)]
    header += [f"element vertex {len(splats.centers)}", *(f"property float {name}" for name in table), "end_header"]
    rows = np.stack(list(table.values()), axis=1).astype("<f4")
    return "\n".join([*header, ""]).encode("ascii", "replace") + rows.tobytes()


def columns(splats: Splats, third_scale: bool, sh_degree: int | None = None) -> dict[str, np.ndarray]:
    """Property -> (N,) values, in the file's order. The harmonics' rest goes channel by channel."""
    primitive, splats = primitive_of(splats), mapped(splats, Tensor.double)
    centers, opacities, quaternions = (part.numpy() for part in (splats.centers, splats.opacities, splats.rotations))
    quaternions = quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)
    facing = primitive.normals(splats).numpy()
    sh = splats.sh.numpy()
    if sh_degree is not None and sh.shape[1] < (sh_degree + 1) ** 2:
        sh = np.pad(sh, ((0, 0), (0, (sh_degree + 1) ** 2 - sh.shape[1]), (0, 0)))
    rest = sh[:, 1:].transpose(0, 2, 1).reshape(len(sh), -1)
    inside = opacities.clip(OPACITY_ENDS, 1 - OPACITY_ENDS)
    logs = np.log(primitive.three_scales(splats) if third_scale else primitive.axis_scales(splats).numpy())
    return {
        **dict(zip("xyz", centers.T, strict=True)),
        **dict(zip(("nx", "ny", "nz"), facing.T, strict=True)),
        **{f"f_dc_{c}": sh[:, 0, c] for c in range(3)},
        **{f"f_rest_{j}": rest[:, j] for j in range(rest.shape[1])},
        "opacity": np.log(inside / (1 - inside)),
        **{f"scale_{j}": logs[:, j] for j in range(logs.shape[1])},
        **{f"rot_{j}": quaternions[:, j] for j in range(4)},
    }
