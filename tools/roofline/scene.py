"""Counts of one view: how much there is to do, by our tile lists and by gsplat's."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor

from room2dgs import _C
from room2dgs.geometry.rotations import rotation_matrices
from room2dgs.splat import Surfels
from room2dgs.splat.constants import OPACITY_FLOOR

TILE = 16
EVERY = 4  # blended pairs are counted in every n-th tile
COLUMNS = 11  # of `_C.bench.tile_work`
# Boxes about discs close beside the camera cover the whole picture: gsplat lists them everywhere, as it does with its
# default near plane. That is a matter of settings, so it gets the original 2DGS's.
NEAR_M, GSPLAT_DEFAULT_NEAR_M = 0.2, 0.01


class Counts(NamedTuple):
    """Of one view. A warp pair is a warp, 32 pixels, and a surfel: our 8 x 4 look at those alone that reach them,
    gsplat's 16 x 2 at all in the list.

    Attributes:
        surfels, visible, entries: in the scene, in the view, and (surfel, tile) pairs.
        pixels, tiles: of the image.
        forward_entries: entries until their tile is dark.
        forward_warps: warp pairs looked at until every pixel of the warp is dark.
        backward_warps: likewise until the warp's last surfel that is blended.
        kept_warps: warp pairs with a pixel that is blended.
        kept: (pixel, surfel) pairs that are blended.
    """

    surfels: float
    visible: float
    entries: float
    pixels: float
    tiles: float
    forward_entries: float
    forward_warps: float
    backward_warps: float
    kept_warps: float
    kept: float


def measured(surfels: Surfels, K: Tensor, cam_from_world: Tensor, width: int, height: int) -> tuple[Counts, Counts]:
    """(ours, gsplat's) of one view, drawn by the CPU's kernels.

    gsplat lists a surfel in every tile of the box about three standard deviations. Its lists are walked to the same
    depth as ours, so its warp pairs are those of our lists times the ratio of the entries up to there, tile by tile.
    Both have the near plane at `NEAR_M`.
    """
    images = [torch.empty(height, width, *tail) for tail in ((3,), (), (), (), (3,))]
    frame: Any = _C.RasterFrame()  # its stubs know arrays alone
    frame.forward(
        *surfels, cam_from_world.double(), K.double(), width, height, NEAR_M, OPACITY_FLOOR, torch.zeros(3),
        *images, None
    )  # fmt: skip
    columns, rows = -(-width // TILE), -(-height // TILE)
    work = np.empty((columns * rows, COLUMNS))
    _C.bench.tile_work(frame, EVERY, work)
    listed, forward, _, warp_forward, warp_backward, dark, *some = work.T
    sampled = some[0] >= 0
    share = warp_backward.sum() / max(1.0, warp_backward[sampled].sum())
    kept, kept_warps, near_forward, near_backward, kept_patches = (x[sampled].sum() * share for x in some)
    ours = Counts(
        len(surfels.centers), frame.visible, listed.sum(), width * height, columns * rows, forward.sum(),
        near_forward, near_backward, kept_patches, kept,
    )  # fmt: skip
    theirs_listed, theirs_walked, visible = boxes(surfels, K, cam_from_world, width, height, dark)
    ratio = theirs_walked / np.maximum(1.0, forward)
    theirs = ours._replace(
        visible=visible, entries=theirs_listed.sum(), forward_entries=theirs_walked.sum(),
        forward_warps=(warp_forward * ratio).sum(), backward_warps=(warp_backward * ratio).sum(),
        kept_warps=kept_warps,
    )  # fmt: skip
    return ours, theirs


def boxes(
    surfels: Surfels,
    K: Tensor,
    cam_from_world: Tensor,
    width: int,
    height: int,
    dark: np.ndarray | None = None,
    near_m: float = NEAR_M,
) -> tuple[np.ndarray, np.ndarray, int]:
    """Per tile: entries of boxes of three standard deviations about the discs; those no deeper than `dark` (all).

    Returns:
        both (tiles,), and the number of surfels with an entry.
    """
    columns, rows = -(-width // TILE), -(-height // TILE)
    dark = np.full(columns * rows, np.inf) if dark is None else dark
    R, t = cam_from_world[:3, :3].double(), cam_from_world[:3, 3].double()
    p = surfels.centers.double() @ R.T + t
    edges = (R @ rotation_matrices(surfels.rotations.double()))[:, :, :2] * surfels.scales.double()[:, None, :]
    rows_of = K.double() @ torch.cat([edges, p[..., None]], dim=-1)  # (N, 3, 3): (u, v, 1) to homogeneous pixels
    sign = torch.tensor([1.0, 1.0, -1.0], dtype=torch.float64)
    w = rows_of[:, 2]
    distance = (sign * w * w).sum(-1)
    f = sign / torch.where(distance == 0, torch.ones_like(distance), distance)[:, None]
    middle = torch.stack([(f * rows_of[:, k] * w).sum(-1) for k in (0, 1)], dim=-1)
    spread = middle.square() - torch.stack([(f * rows_of[:, k].square()).sum(-1) for k in (0, 1)], dim=-1)
    half = (3 * spread.clamp_min(1e-4).sqrt()).ceil()
    limit = torch.tensor([columns, rows], dtype=torch.float64)
    first = ((middle - half) / TILE).floor().clamp_min(0).minimum(limit)
    end = ((middle + half) / TILE).ceil().clamp_min(0).minimum(limit)
    count = (end - first).clamp_min(0).prod(-1)
    count = torch.where((p[:, 2] >= near_m) & (distance != 0), count, torch.zeros_like(count))
    seen = count > 0
    begin, stop, depth = (x[seen].numpy() for x in (first, end, p[:, 2]))
    listed, walked = np.zeros((2, columns * rows))
    # as many passes as the largest box has tiles; the long tail of large boxes is short
    wide, size = (stop - begin)[:, 0].astype(np.int64), (stop - begin).prod(-1).astype(np.int64)
    origin = (begin[:, 1] * columns + begin[:, 0]).astype(np.int64)
    left = np.arange(len(size))
    for k in range(int(size.max(initial=0))):
        left = left[size[left] > k]
        tile = origin[left] + k // wide[left] * columns + k % wide[left]
        listed += np.bincount(tile, minlength=len(listed))
        walked += np.bincount(tile[depth[left] <= dark[tile]], minlength=len(listed))
    return listed, walked, int(seen.sum())
