"""Surfaces that the room is made of: grids of vertices with a material each.

Everything in the room is a `Patch`. Solids (box, cylinder, sphere) are lists of patches whose normals
(d/du x d/dv) point outwards. Furniture is built in a local frame (x along the wall, y into the room, z up)
and moved with `placed`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

FACET = 0.03  # metres, the longest edge around curved things


@dataclass(frozen=True)
class Material:
    """How a surface looks.

    Attributes:
        kind: a name in `demo_room.textures.TEXTURES`, or "emitter" for a light.
        colors: display colours (sRGB, 0-1) that the texture mixes.
    """

    kind: str
    colors: tuple[tuple[float, float, float], ...] = ()


EMITTER = Material("emitter")


@dataclass(frozen=True)
class Patch:
    """A piece of surface parametrised by (u, v) in [0, 1]^2.

    Attributes:
        grid: (nv+1, nu+1, 3) float64 world positions in metres at uniform (u, v). A cell is planar unless its
            edges are at most `FACET` long, so that splitting cells bilinearly never leaves the surface.
        size: metres along u and along v, the scale of the texture.
        material: how it looks.
        tag: what it belongs to ("floor", "wall0", "chair", ...).
    """

    grid: np.ndarray
    size: tuple[float, float]
    material: Material
    tag: str = ""

    def points_at(self, u: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Positions and unit normals, both (..., 3) float64, at parameters u and v (of one shape, 0 to 1)."""
        rows, columns = self.grid.shape[0] - 1, self.grid.shape[1] - 1
        j = np.clip((u * columns).astype(int), 0, columns - 1)
        i = np.clip((v * rows).astype(int), 0, rows - 1)
        s, t = (u * columns - j)[..., None], (v * rows - i)[..., None]
        p00, p01 = self.grid[i, j], self.grid[i, j + 1]
        p10, p11 = self.grid[i + 1, j], self.grid[i + 1, j + 1]
        along_u = (1 - t) * (p01 - p00) + t * (p11 - p10)
        along_v = (1 - s) * (p10 - p00) + s * (p11 - p01)
        normal = np.cross(along_u, along_v)
        normal /= np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-12)
        return (1 - t) * ((1 - s) * p00 + s * p01) + t * ((1 - s) * p10 + s * p11), normal

    def refined(self, max_edge: float) -> Patch:
        """The same surface with cells split until no grid edge is longer than `max_edge` (metres)."""
        rows, columns = self.grid.shape[0] - 1, self.grid.shape[1] - 1
        longest_u = np.linalg.norm(np.diff(self.grid, axis=1), axis=-1).max()
        longest_v = np.linalg.norm(np.diff(self.grid, axis=0), axis=-1).max()
        columns *= max(1, int(np.ceil(longest_u / max_edge - 1e-9)))
        rows *= max(1, int(np.ceil(longest_v / max_edge - 1e-9)))
        u, v = np.meshgrid(np.linspace(0, 1, columns + 1), np.linspace(0, 1, rows + 1))
        return replace(self, grid=self.points_at(u, v)[0])


@dataclass(frozen=True)
class TriangleSoup:
    """Triangles of many patches, in patch order.

    Attributes:
        vertices: (V, 3) float32, metres.
        triangles: (T, 3) uint32.
        patch: (T,) int32, the patch of each triangle.
        uv: (T, 3, 2) float32, patch parameters of the corners.
        uv_frames: (T, 6) float32, uv of the first corner and of the two edges from it: one row a lookup.
    """

    vertices: np.ndarray
    triangles: np.ndarray
    patch: np.ndarray
    uv: np.ndarray
    uv_frames: np.ndarray


def triangulated(patches: list[Patch]) -> TriangleSoup:
    """Two triangles a grid cell, wound so that normals are d/du x d/dv; those without area are dropped."""
    vertices, triangles, owners, corner_uv = [], [], [], []
    first = 0
    for index, patch in enumerate(patches):
        rows, columns = patch.grid.shape[0] - 1, patch.grid.shape[1] - 1
        ids = np.arange((rows + 1) * (columns + 1)).reshape(rows + 1, columns + 1)
        a, b, c, d = ids[:-1, :-1].ravel(), ids[:-1, 1:].ravel(), ids[1:, 1:].ravel(), ids[1:, :-1].ravel()
        faces = np.stack([np.stack([a, b, c], 1), np.stack([a, c, d], 1)], 1).reshape(-1, 3)
        points = patch.grid.reshape(-1, 3)
        edges = points[faces[:, 1:]] - points[faces[:, :1]]
        faces = faces[np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1) > 1e-12]
        u, v = np.meshgrid(np.linspace(0, 1, columns + 1), np.linspace(0, 1, rows + 1))
        vertices.append(points)
        triangles.append(faces + first)
        owners.append(np.full(len(faces), index))
        corner_uv.append(np.stack([u.ravel(), v.ravel()], 1)[faces])
        first += len(points)
    uv = np.concatenate(corner_uv).astype(np.float32)
    return TriangleSoup(
        vertices=np.concatenate(vertices).astype(np.float32),
        triangles=np.concatenate(triangles).astype(np.uint32),
        patch=np.concatenate(owners).astype(np.int32),
        uv=uv,
        uv_frames=np.concatenate([uv[:, 0], uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]], axis=1),
    )


def placed(patches: list[Patch], origin: tuple[float, float, float], yaw: float) -> list[Patch]:
    """Patches turned by `yaw` (radians about z) and then moved by `origin` (metres)."""
    cos, sin = np.cos(yaw), np.sin(yaw)
    rotation = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    return [replace(patch, grid=patch.grid @ rotation.T + np.asarray(origin, float)) for patch in patches]


def parallelogram(corner, along_u, along_v, material: Material, tag: str = "") -> Patch:
    """A flat patch; its normal is along_u x along_v."""
    corner, along_u, along_v = (np.asarray(x, float) for x in (corner, along_u, along_v))
    grid = np.stack([np.stack([corner, corner + along_u]), np.stack([corner + along_v, corner + along_u + along_v])])
    return Patch(grid, (float(np.linalg.norm(along_u)), float(np.linalg.norm(along_v))), material, tag)


def box(low, high, material: Material, tag: str = "", **faces: Material) -> list[Patch]:
    """Six faces of an axis-aligned box from corner `low` to corner `high`.

    Args:
        faces: other materials for single faces: left (-x), right (+x), back (-y), front (+y), bottom, top.
    """
    low, high = np.asarray(low, float), np.asarray(high, float)
    x, y, z = np.diag(high - low)
    sides = {
        "left": (low + y, -y, z),
        "right": (low + x, y, z),
        "back": (low, x, z),
        "front": (low + x + y, -x, z),
        "bottom": (low + y, x, -y),
        "top": (low + z, x, y),
    }
    return [parallelogram(*side, faces.get(name, material), tag) for name, side in sides.items()]


def cylinder(
    centre, radius: float, height: float, material: Material, tag: str = "", top_radius: float | None = None
) -> list[Patch]:
    """A standing cylinder or cone with caps; `centre` is the middle of its bottom disc."""
    centre = np.asarray(centre, float)
    top_radius = radius if top_radius is None else top_radius
    n = max(12, int(np.ceil(2 * np.pi * max(radius, top_radius) / FACET)))
    angle = np.linspace(0, 2 * np.pi, n + 1)
    ring = np.stack([np.cos(angle), np.sin(angle), np.zeros(n + 1)], 1)
    ring[-1] = ring[0]
    up = np.array([0.0, 0.0, height])
    grid = np.stack([centre + radius * ring, centre + up + top_radius * ring])
    side = Patch(grid, (2 * np.pi * max(radius, top_radius), height), material, tag)
    return [side, disc(centre + up, top_radius, material, tag), disc(centre, -radius, material, tag)]


def disc(centre, radius: float, material: Material, tag: str = "") -> Patch:
    """A flat disc facing up, or down for a negative radius; the unit square is bent onto it elliptically."""
    n = max(6, int(np.ceil(3 * abs(radius) / FACET)))
    x, y = np.meshgrid(np.linspace(-1, 1, n + 1), np.linspace(-1, 1, n + 1))
    grid = np.stack([x * np.sqrt(1 - y**2 / 2), y * np.sqrt(1 - x**2 / 2), np.zeros_like(x)], -1)
    grid = grid * np.array([radius, abs(radius), 0.0]) + np.asarray(centre, float)
    return Patch(grid, (2 * abs(radius), 2 * abs(radius)), material, tag)


def sphere(centre, radius: float, material: Material, tag: str = "", squash: float = 1.0) -> Patch:
    """A sphere, flattened along z by `squash`."""
    n = max(12, int(np.ceil(2 * np.pi * radius / FACET)))
    angle = np.linspace(0, 2 * np.pi, n + 1)
    height = np.linspace(-np.pi / 2, np.pi / 2, n // 2 + 1)[:, None]
    grid = np.stack(
        [np.cos(height) * np.cos(angle), np.cos(height) * np.sin(angle), squash * np.sin(height) + 0 * angle],
        -1,
    )
    grid[:, -1] = grid[:, 0]
    grid[0, :, :2] = grid[-1, :, :2] = 0.0
    grid = radius * grid + np.asarray(centre, float)
    return Patch(grid, (2 * np.pi * radius, np.pi * radius * squash), material, tag)


def curtain(width: float, height: float, depth: float, folds: float, material: Material, tag: str = "") -> Patch:
    """A wavy sheet facing +y: x from 0 to width, z from 0 to height, y = depth times a wave."""
    n = int(np.ceil(2 * width / FACET))
    x = np.linspace(width, 0, n + 1)
    wave = depth * (np.sin(2 * np.pi * folds * x / width) + 0.4 * np.sin(2 * np.pi * 0.37 * folds * x / width + 1))
    row = np.stack([x, wave, np.zeros_like(x)], 1)
    grid = np.stack([row, row + np.array([0.0, 0.0, height])])
    return Patch(grid, (1.3 * width, height), material, tag)
