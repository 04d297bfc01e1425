"""The empty room: floor, walls with openings and recesses, ceilings flat or slanted, spaces behind open doorways."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from room2dgs.demo_room.geometry import Material, Patch, box, parallelogram
from room2dgs.tools.random_rooms import materials
from room2dgs.tools.random_rooms.shapes import block, lathe, moved


@dataclass(frozen=True)
class Opening:
    """A rectangular hole in a wall, or what stands for one: metres along the wall and above the floor.

    Attributes:
        kind: "door" (open or closed), "window", "niche"; "" for none of them.
    """

    start: float
    end: float
    low: float
    high: float
    kind: str = ""


@dataclass
class Space:
    """A prism of air over a floor plan.

    Attributes:
        outline: (N, 2) corners of the floor, counter-clockwise, metres.
        profile: (K, 2) y and ceiling height, y rising; heights between are linear, so that slanted ceilings rise
            along y.
        openings: for each wall (from corner i to i + 1) its holes.
        mounted: likewise doors and windows that are fixed on the wall, which is whole behind them.
    """

    outline: np.ndarray
    profile: np.ndarray
    openings: dict[int, list[Opening]] = field(default_factory=dict)
    mounted: dict[int, list[Opening]] = field(default_factory=dict)

    def top(self, y) -> np.ndarray:
        """Ceiling height at y."""
        return np.interp(y, self.profile[:, 0], self.profile[:, 1])

    def contains(self, points: np.ndarray) -> np.ndarray:
        """(N,) bool: points (N, 2) over the floor."""
        return in_polygon(points, self.outline)

    def encloses(self, points: np.ndarray) -> np.ndarray:
        """(N,) bool: points (N, 3) between floor, walls and ceiling."""
        return self.contains(points[:, :2]) & (points[:, 2] > 0) & (points[:, 2] < self.top(points[:, 1]))

    def wall(self, index: int) -> tuple[np.ndarray, float, float]:
        """Start (2,), length and yaw of a wall; in its frame x runs along it and +y into the room."""
        start, end = self.outline[index], self.outline[(index + 1) % len(self.outline)]
        along = end - start
        return start, float(np.linalg.norm(along)), float(np.arctan2(along[1], along[0]))

    def wall_height(self, index: int, start: float, end: float) -> float:
        """Lowest ceiling over a stretch of a wall (metres along it)."""
        corner, _, yaw = self.wall(index)
        return float(self.top(corner[1] + np.sin(yaw) * np.array([start, end])).min())

    def on_wall(self, patches: list[Patch], index: int, along: float, height: float = 0.0) -> list[Patch]:
        """Patches moved from a wall piece's frame to `along` metres from the wall's start."""
        start, _, yaw = self.wall(index)
        origin = start + along * np.array([np.cos(yaw), np.sin(yaw)])
        return moved(patches, (*origin, height), yaw)


def in_polygon(points: np.ndarray, outline: np.ndarray) -> np.ndarray:
    """(N,) bool: points (N, 2) inside a simple polygon."""
    x, y = points[:, :1], points[:, 1:2]
    following = np.roll(outline, -1, axis=0)
    crosses = (outline[:, 1] > y) != (following[:, 1] > y)
    rise = np.where(following[:, 1] == outline[:, 1], 1.0, following[:, 1] - outline[:, 1])
    at = outline[:, 0] + (y - outline[:, 1]) / rise * (following[:, 0] - outline[:, 0])
    return (crosses & (x < at)).sum(axis=1) % 2 == 1


def trapezoids(outline: np.ndarray, cuts: np.ndarray) -> list[np.ndarray]:
    """The polygon cut into bands along y: quads (4, 2) counter-clockwise from the lower left."""
    levels = np.unique(np.round(np.concatenate([outline[:, 1], cuts]), 6))
    levels = levels[(levels >= outline[:, 1].min() - 1e-6) & (levels <= outline[:, 1].max() + 1e-6)]
    following = np.roll(outline, -1, axis=0)
    quads = []
    for low, high in pairwise(levels):
        if high - low < 1e-4:
            continue
        middle, sides = (low + high) / 2, []
        for a, b in zip(outline, following, strict=True):
            if (a[1] > middle) != (b[1] > middle):
                slope = (b[0] - a[0]) / (b[1] - a[1])
                sides.append((a[0] + (middle - a[1]) * slope, slope))
        sides.sort()
        for (x0, s0), (x1, s1) in zip(sides[::2], sides[1::2], strict=True):
            half = (high - low) / 2
            quads.append(
                np.array([(x0 - half * s0, low), (x1 - half * s1, low), (x1 + half * s1, high), (x0 + half * s0, high)])
            )
    return quads


def quad(a, b, c, d, material: Material, tag: str) -> Patch:
    """A flat patch with corners a, b (along u), then d, c."""
    grid = np.array([[a, b], [d, c]], float)
    size = (
        max(float(np.linalg.norm(grid[0, 1] - grid[0, 0])), float(np.linalg.norm(grid[1, 1] - grid[1, 0])), 1e-3),
        max(float(np.linalg.norm(grid[1, 0] - grid[0, 0])), float(np.linalg.norm(grid[1, 1] - grid[0, 1])), 1e-3),
    )
    return Patch(grid, size, material, tag)


def space_patches(space: Space, floor: Material, ceiling: Material, walls: list[Material]) -> list[Patch]:
    """Floor, ceiling and walls around a space, facing its air; openings are left out."""
    patches = []
    for corners in trapezoids(space.outline, np.zeros(0)):
        a, b, c, d = (np.append(p, 0.0) for p in corners)
        patches.append(quad(a, b, c, d, floor, "floor"))
    for corners in trapezoids(space.outline, space.profile[:, 0]):
        a, b, c, d = (np.append(p, space.top(p[1])) for p in corners)
        patches.append(quad(d, c, b, a, ceiling, "ceiling"))
    for index in range(len(space.outline)):
        patches += wall_patches(space, index, walls[index])
    return patches


def wall_patches(space: Space, index: int, material: Material) -> list[Patch]:
    """One wall around its openings, cut where the ceiling bends."""
    start, length, yaw = space.wall(index)
    rise = np.sin(yaw)
    holes = space.openings.get(index, [])
    ends = [0.0, length, *(hole.start for hole in holes), *(hole.end for hole in holes)]
    if abs(rise) > 1e-3:
        ends += list((space.profile[:, 0] - start[1]) / rise)
    cuts = np.unique(np.round(np.clip(ends, 0, length), 6))
    if not holes:
        return space.on_wall([whole_wall(space, index, cuts, material)], index, 0.0)
    patches = []
    for left, right in pairwise(cuts):
        if right - left < 1e-4:
            continue
        tops = space.top(start[1] + rise * np.array([left, right]))
        middle = (left + right) / 2
        inside = sorted((h.low, h.high) for h in holes if h.start < middle < h.end)
        lows = [0.0, *(high for _, high in inside)]
        highs = [*(low for low, _ in inside), None]
        for low, high in zip(lows, highs, strict=True):
            if high is not None and high - low < 1e-4:
                continue
            top_left, top_right = tops if high is None else (high, high)
            if min(top_left, top_right) - low < 1e-4:
                continue
            face = quad(
                (right, 0, low), (left, 0, low), (left, 0, top_left), (right, 0, top_right), material, f"wall{index}"
            )
            patches.append(face)
    return space.on_wall(patches, index, 0.0)


def whole_wall(space: Space, index: int, cuts: np.ndarray, material: Material) -> Patch:
    """A wall without openings as one patch in its frame; cells of like widths, so that its texture is even."""
    start, length, yaw = space.wall(index)
    pieces = [np.linspace(a, b, max(1, round(len(cuts) > 2 and (b - a) / 0.3)) + 1)[:-1] for a, b in pairwise(cuts)]
    x = np.concatenate([*pieces, [length]])[::-1]
    top = space.top(start[1] + np.sin(yaw) * x)
    grid = np.stack([np.column_stack([x, 0 * x, 0 * x]), np.column_stack([x, 0 * x, top])])
    return Patch(grid, (length, float(top.max())), material, f"wall{index}")


def reveal(hole: Opening, depth: float, material: Material, sill: Material | None = None) -> list[Patch]:
    """The four inner faces of a hole in a wall of thickness `depth`, in the wall's frame (behind it: y < 0)."""
    width, height = hole.end - hole.start, hole.high - hole.low
    return [
        parallelogram((hole.start, -depth, hole.low), (0, depth, 0), (0, 0, height), material, "reveal"),
        parallelogram((hole.end, 0, hole.low), (0, -depth, 0), (0, 0, height), material, "reveal"),
        parallelogram((hole.start, -depth, hole.low), (width, 0, 0), (0, depth, 0), sill or material, "reveal"),
        parallelogram((hole.start, 0, hole.high), (width, 0, 0), (0, -depth, 0), material, "reveal"),
    ]


def back_face(hole: Opening, depth: float, material: Material, tag: str) -> Patch:
    """What closes a recess: a face `depth` behind the wall, looking into the room."""
    return parallelogram(
        (hole.end, -depth, hole.low), (hole.start - hole.end, 0, 0), (0, 0, hole.high - hole.low), material, tag
    )


def skirting(space: Space, index: int, height: float, thick: float, material: Material) -> list[Patch]:
    """Boards along a wall's foot, with gaps at openings down to the floor."""
    _, length, _ = space.wall(index)
    gaps = sorted((h.start, h.end) for h in space.openings.get(index, []) if h.low < height)
    levels = [0.0, *(x for gap in gaps for x in gap), length]
    patches = []
    for left, right in zip(levels[::2], levels[1::2], strict=True):
        if right - left > 0.02:
            patches += box((left, 0, 0), (right, thick, height), material, "skirting")[1:]
    return space.on_wall(patches, index, 0.0)


def ceiling_beams(rng: np.random.Generator, space: Space, material: Material) -> list[Patch]:
    """Beams under a flat ceiling, across the whole plan along x."""
    low, high = space.outline.min(axis=0), space.outline.max(axis=0)
    thick, drop = rng.uniform(0.06, 0.22), rng.uniform(0.06, 0.25)
    count = int(rng.integers(1, 7))
    patches = []
    for y in np.linspace(low[1], high[1], count + 2)[1:-1]:
        z = float(space.top(y))
        beam = block(high[0] - low[0], thick, drop + 0.01, material, "beam")
        patches += moved(beam, ((low[0] + high[0]) / 2, y, z - drop))
    return patches


def pillar(rng: np.random.Generator, height: float, material: Material) -> list[Patch]:
    """A square or round column from floor to ceiling."""
    wide = rng.uniform(0.15, 0.45)
    if rng.random() < 0.4:
        return [lathe([(wide / 2, 0.0), (wide / 2, height)], material, "pillar")]
    return block(wide, wide * rng.uniform(0.7, 1.4), height, material, "pillar")


def moulding(rng: np.random.Generator, space: Space, material: Material) -> list[Patch]:
    """A strip under a flat ceiling along all walls."""
    tall, thick, top = rng.uniform(0.04, 0.12), rng.uniform(0.02, 0.1), float(space.profile[0, 1])
    patches = []
    for index in range(len(space.outline)):
        strip = box((0, 0, top - tall), (space.wall(index)[1], thick, top), material, "moulding")
        patches += space.on_wall(strip, index, 0.0)
    return patches


def wall_materials(
    rng: np.random.Generator, count: int, cover: Callable[[np.random.Generator], Material] | None = None
) -> list[Material]:
    """One material a wall: mostly the same all around, at times one accent, at times all different."""
    main = cover(rng) if cover and rng.random() < 0.7 else materials.wall(rng)
    kind = rng.random()
    if kind < 0.55:
        return [main] * count
    if kind < 0.85:
        accent, which = materials.wall(rng), int(rng.integers(count))
        return [accent if k == which else main for k in range(count)]
    return [materials.wall(rng) for _ in range(count)]
