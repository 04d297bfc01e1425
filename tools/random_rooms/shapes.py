"""Solids and sheets beyond those of `demo_room.geometry`: rounded boxes, lathes, tubes, prisms, two-sided sheets.

Each is a list of patches (or one patch) in metres, normals outwards. Round things have at least 16 facets a turn.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from room2dgs.demo_room.geometry import Material, Patch, box

FACET = 0.035  # metres, the edge that curved things aim at


def rotation(yaw: float, pitch: float = 0.0, roll: float = 0.0) -> np.ndarray:
    """(3, 3) turn about x by `roll`, then about y by `pitch`, then about z by `yaw` (radians)."""
    (cy, sy), (cp, sp), (cr, sr) = ((np.cos(a), np.sin(a)) for a in (yaw, pitch, roll))
    about_z = np.array([[cy, -sy, 0.0], [sy, cy, 0.0], [0.0, 0.0, 1.0]])
    about_y = np.array([[cp, 0.0, sp], [0.0, 1.0, 0.0], [-sp, 0.0, cp]])
    about_x = np.array([[1.0, 0.0, 0.0], [0.0, cr, -sr], [0.0, sr, cr]])
    return about_z @ about_y @ about_x


def moved(patches: list[Patch], origin=(0.0, 0.0, 0.0), turn: np.ndarray | float = 0.0) -> list[Patch]:
    """Patches turned by `turn` (radians about z, or a (3, 3) rotation), then shifted by `origin` (metres)."""
    matrix = turn if isinstance(turn, np.ndarray) else rotation(turn)
    shift = np.asarray(origin, float)
    return [Patch(patch.grid @ matrix.T + shift, patch.size, patch.material, patch.tag) for patch in patches]


def extent(patches: list[Patch]) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest corner (3,) of patches."""
    points = np.concatenate([patch.grid.reshape(-1, 3) for patch in patches])
    return points.min(axis=0), points.max(axis=0)


def resting(patches: list[Patch], turn: np.ndarray | float = 0.0) -> list[Patch]:
    """Patches turned and put with the lowest point on z = 0, their middle at x = y = 0."""
    turned = moved(patches, (0, 0, 0), turn)
    low, high = extent(turned)
    middle = (low + high) / 2
    return moved(turned, (-middle[0], -middle[1], -low[2]))


def block(width: float, depth: float, height: float, material: Material, tag: str = "", **faces) -> list[Patch]:
    """A box standing on z = 0, centred on x = y = 0."""
    return box((-width / 2, -depth / 2, 0.0), (width / 2, depth / 2, height), material, tag, **faces)


def bar(start, end, width: float, material: Material, tag: str = "", thick: float | None = None) -> list[Patch]:
    """A straight bar of rectangular section between two points."""
    start, end = np.asarray(start, float), np.asarray(end, float)
    frame, length = frame_along(end - start)
    thick = width if thick is None else thick
    return moved(block(width, thick, length, material, tag), start, frame)


def frame_along(axis: np.ndarray) -> tuple[np.ndarray, float]:
    """(3, 3) rotation whose third column is `axis`, and the axis' length."""
    length = float(np.linalg.norm(axis))
    z = axis / length
    helper = np.array([0.0, 1.0, 0.0]) if abs(z[1]) < 0.9 else np.array([1.0, 0.0, 0.0])
    x = np.cross(helper, z)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z]), length


def lathe(profile, material: Material, tag: str = "", segments: int | None = None) -> Patch:
    """A solid of revolution about z.

    Args:
        profile: (N, 2) radius and height, from the bottom along the outside; it closes where the radius is 0.
    """
    profile = np.asarray(profile, float)
    largest = profile[:, 0].max()
    n = segments or int(np.clip(np.ceil(2 * np.pi * largest / FACET), 16, 40))
    angle = np.linspace(0, 2 * np.pi, n + 1)
    angle[-1] = 0.0
    radius, z = profile[:, :1], profile[:, 1:]
    grid = np.stack([radius * np.cos(angle), radius * np.sin(angle), z + 0 * angle], -1)
    length = float(np.linalg.norm(np.diff(profile, axis=0), axis=1).sum())
    return Patch(grid, (2 * np.pi * largest, length), material, tag)


def rod(start, end, radius: float, material: Material, tag: str = "", end_radius: float | None = None) -> Patch:
    """A closed round bar or cone between two points."""
    start, end = np.asarray(start, float), np.asarray(end, float)
    frame, length = frame_along(end - start)
    top = radius if end_radius is None else end_radius
    patch = lathe([(0, 0), (radius, 0), (top, length), (0, length)], material, tag)
    return moved([patch], start, frame)[0]


def tube(points, radius: float, material: Material, tag: str = "", segments: int = 12) -> Patch:
    """A round tube along a polyline (N, 3), closed at both ends."""
    points = np.asarray(points, float)
    tangent = np.gradient(points, axis=0)
    tangent /= np.maximum(np.linalg.norm(tangent, axis=1, keepdims=True), 1e-9)
    side = frame_along(tangent[0])[0][:, 0]
    angle = np.linspace(0, 2 * np.pi, segments + 1)[:, None]
    rings = [np.repeat(points[:1], segments + 1, axis=0)]
    for point, along in zip(points, tangent, strict=True):
        side = side - along * (side @ along)
        side /= max(np.linalg.norm(side), 1e-9)
        rings.append(point + radius * (np.cos(angle) * side + np.sin(angle) * np.cross(along, side)))
    rings.append(np.repeat(points[-1:], segments + 1, axis=0))
    grid = np.stack(rings)
    grid[:, -1] = grid[:, 0]
    length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    return Patch(grid, (2 * np.pi * radius, length + 2 * radius), material, tag)


def ellipsoid(half, material: Material, tag: str = "") -> Patch:
    """An ellipsoid of half axes (3,) about the origin."""
    half = np.asarray(half, float)
    n = int(np.clip(np.ceil(2 * np.pi * half.max() / FACET), 16, 36))
    height = np.linspace(-np.pi / 2, np.pi / 2, max(8, n // 2) + 1)
    unit = lathe(np.column_stack([np.cos(height) * (np.abs(height) < 1.57), np.sin(height)]), material, tag, n)
    return replace(unit, grid=unit.grid * half, size=(2 * np.pi * half[:2].max(), np.pi * half[2]))


def rounded_box(
    half, radius: float, material: Material, tag: str = "", bulge: float = 0.0, step: float = 0.06
) -> Patch:
    """A box with round edges about the origin, one patch of cells of about `step` metres.

    Args:
        half: (3,) half sizes; `radius` of the edges is cut to the smallest.
        bulge: share by which the middle of top and bottom swells, for cushions.
    """
    half = np.asarray(half, float)
    radius = float(min(radius, half.min() * 0.999))
    inner = half - radius
    step = float(np.clip(step, (half.sum()) / 18, 0.3))
    arc = max(2, int(np.ceil(0.5 * np.pi * radius / step)), 3 if radius > 0.02 else 2)
    corners = np.array([(1, 1), (-1, 1), (-1, -1), (1, -1)]) * inner[:2]
    centres: list[np.ndarray] = []
    outs: list[np.ndarray] = []
    for k in range(4):
        angle = k * np.pi / 2 + np.linspace(0, np.pi / 2, arc + 1)
        centres.append(np.repeat(corners[k : k + 1], arc + 1, axis=0))
        outs.append(np.column_stack([np.cos(angle), np.sin(angle)]))
        following = corners[(k + 1) % 4]
        cells = max(1, int(np.ceil(np.linalg.norm(following - corners[k]) / step)))
        share = np.linspace(0, 1, cells + 1)[1:-1, None]
        centres.append(corners[k] + share * (following - corners[k]))
        outs.append(np.repeat(outs[-1][-1:], cells - 1, axis=0))
    centre, out = np.concatenate([*centres, corners[:1]]), np.concatenate([*outs, [[1.0, 0.0]]])
    fan = np.linspace(0, 1, max(1, int(np.ceil(inner[:2].min() / step))) + 1)
    latitude = np.linspace(0, np.pi / 2, arc + 1)
    tall = np.linspace(-inner[2], inner[2], max(1, int(np.ceil(2 * inner[2] / step))) + 1)
    rows = [(share, 0.0, -half[2]) for share in fan[:-1]]
    rows += [(1.0, radius * np.sin(a), -inner[2] - radius * np.cos(a)) for a in latitude]
    rows += [(1.0, radius, z) for z in tall[1:-1]]
    rows += [(1.0, radius * np.cos(a), inner[2] + radius * np.sin(a)) for a in latitude]
    rows += [(share, 0.0, half[2]) for share in fan[-2::-1]]
    grid = np.stack([np.column_stack([s * centre + r * out, np.full(len(centre), z)]) for s, r, z in rows])
    if bulge:
        swell = (1 - (grid[..., 0] / half[0]) ** 2) * (1 - (grid[..., 1] / half[1]) ** 2)
        grid[..., 2] *= 1 + bulge * np.maximum(swell, 0)
    around = 4 * float(half[:2].sum())
    return Patch(grid, (around, 2 * float(half[2] + half[:2].min())), material, tag)


def cushion(width: float, depth: float, height: float, material: Material, tag: str = "cushion") -> list[Patch]:
    """A soft box standing on z = 0, centred on x = y = 0."""
    patch = rounded_box((width / 2, depth / 2, height / 2), 0.42 * height, material, tag, bulge=0.25)
    return moved([patch], (0, 0, height / 2))


def prism(outline, height: float, material: Material, tag: str = "", top: Material | None = None) -> list[Patch]:
    """A straight prism on z = 0 over a star-shaped outline (N, 2), counter-clockwise."""
    outline = np.asarray(outline, float)
    ring = np.column_stack([outline, np.zeros(len(outline))])
    up = np.array([0.0, 0.0, height])
    patches = []
    for start, end in zip(ring, np.roll(ring, -1, axis=0), strict=True):
        grid = np.stack([np.stack([start, end]), np.stack([start, end]) + up])
        patches.append(Patch(grid, (float(np.linalg.norm(end - start)), height), material, tag))
    closed = np.concatenate([ring, ring[:1]])
    middle = np.repeat(ring.mean(axis=0, keepdims=True), len(closed), axis=0)
    size = float(np.ptp(outline, axis=0).max())
    patches.append(Patch(np.stack([closed, middle]) + up, (3 * size, size / 2), top or material, tag))
    patches.append(Patch(np.stack([middle, closed]), (3 * size, size / 2), material, tag))
    return patches


def flipped(patch: Patch, shift=(0.0, 0.0, 0.0)) -> Patch:
    """The same surface seen from behind, moved by `shift`."""
    return replace(patch, grid=patch.grid[:, ::-1] + np.asarray(shift, float))


def two_sided(patch: Patch, thickness: float = 0.002) -> list[Patch]:
    """A sheet with a back: the patch and its reverse, `thickness` behind it along its mean normal."""
    u, v = np.meshgrid(np.linspace(0.05, 0.95, 5), np.linspace(0.05, 0.95, 5))
    normal = patch.points_at(u, v)[1].reshape(-1, 3).mean(axis=0)
    normal /= max(np.linalg.norm(normal), 1e-9)
    return [patch, flipped(patch, -thickness * normal)]
