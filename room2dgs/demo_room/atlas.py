"""Charts of all patches packed side by side in one picture, so that a whole frame is shaded by one remap."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from room2dgs.demo_room.geometry import Patch
from room2dgs.demo_room.textures import texture

TEXEL = 0.003  # metres a texel of colour
LIGHT_TEXEL = 0.05  # metres a texel of light


@dataclass(frozen=True)
class Charts:
    """Where each patch lies in an atlas.

    Attributes:
        corner: (P, 2) int, column and row of the chart's first texel (u = v = 0).
        size: (P, 2) int, texels along u and along v, at least 2.
        shape: rows and columns of the atlas.
    """

    corner: np.ndarray
    size: np.ndarray
    shape: tuple[int, int]

    def texels(self, patch: np.ndarray, uv: np.ndarray) -> np.ndarray:
        """Atlas coordinates (N, 2) float32 (column, row; texel centres at integers) of uv (N, 2) on patches.

        Clamped to the centres of the outermost texels: bilinear lookups never read a neighbouring chart.
        """
        size = self.size.astype(np.float32).take(patch, axis=0)
        inside = uv * size
        inside -= np.float32(0.5)
        np.maximum(inside, 0, out=inside)
        np.minimum(inside, size - 1, out=inside)
        inside += self.corner.astype(np.float32).take(patch, axis=0)
        return inside


def pack(patches: list[Patch], texel: float, width: int) -> Charts:
    """Rows of charts, the tallest first."""
    size = np.array([[max(2, round(edge / texel)) for edge in patch.size] for patch in patches])
    corner = np.zeros_like(size)
    x = y = row_height = 0
    for index in np.argsort(-size[:, 1], kind="stable"):
        if x + size[index, 0] > width:
            x, y, row_height = 0, y + row_height, 0
        corner[index] = x, y
        x += size[index, 0]
        row_height = max(row_height, size[index, 1])
    return Charts(corner, size, (int(y + row_height), width))


def lookup(atlas: np.ndarray, texels: np.ndarray) -> np.ndarray:
    """Bilinear values (N, C) of an (H, W, C) atlas at coordinates (N, 2) from `Charts.texels`."""
    rows = -(-len(texels) // 1024)  # cv2 limits the width of a map
    padded = texels
    if rows * 1024 != len(texels):
        padded = np.zeros((rows * 1024, 2), np.float32)
        padded[: len(texels)] = texels
    values = cv2.remap(atlas, padded.reshape(rows, 1024, 2), None, cv2.INTER_LINEAR)  # type: ignore[call-overload]
    return values.reshape(rows * 1024, -1)[: len(texels)]


def paint_atlas(patches: list[Patch], charts: Charts, seed: int) -> np.ndarray:
    """(H, W, 3) uint8 sRGB colours of all patches; each patch draws from a stream of its own."""
    atlas = np.zeros((*charts.shape, 3), np.uint8)
    for index, (patch, (x, y), (w, h)) in enumerate(zip(patches, charts.corner, charts.size, strict=True)):
        rng = np.random.default_rng([seed, 3, index])
        image = texture(patch.material, (w * TEXEL, h * TEXEL), TEXEL, rng)
        atlas[y : y + h, x : x + w] = image[::-1]  # v points up, rows of a picture down
    return atlas


def srgb_to_linear(values: np.ndarray) -> np.ndarray:
    """Linear light in [0, 1], float32, of uint8 sRGB values."""
    code = np.arange(256) / 255
    table = np.where(code <= 0.04045, code / 12.92, ((code + 0.055) / 1.055) ** 2.4)
    return table.astype(np.float32).take(values)


def linear_to_srgb(values: np.ndarray) -> np.ndarray:
    """sRGB values in [0, 1], float32, of linear light; above 1 is clipped."""
    values = np.clip(values, 0, 1).astype(np.float32)
    return np.where(values <= 0.0031308, 12.92 * values, 1.055 * values ** np.float32(1 / 2.4) - 0.055)
