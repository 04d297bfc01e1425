"""Rectangles on a wall between lines that stand out, and what speaks for each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from room2dgs.plan.wall_map import CELL_M, Evidence, Lines, WallMap

PIECE_M = 0.5  # of a line, by which it stands out
SMOOTH = 5  # cells over which evidence is evened out before its steps are sought
EDGE_LINES, STEP_LINES = 24, 8  # of a wall and way, by the photos' edges and by steps of the evidence
STRIP_M = 0.1  # around a rectangle, where the wall should be
TINT_M, TINT = 0.15, 0.06  # around it, whose colour is compared; contrast that counts half
FRAME_CELLS = 2, 3, 4, 5  # width of boards around it
LEAST_RAYS = 3  # of a strip
SLACK = 2.0  # rays that are taken to say nothing
MOST_FRAME_M, CLEAR = 0.1, 0.8  # of a frame's width; strength of its outer edge over that of the pane's side
MOVED_M = 0.15  # by which a side is moved to fit better
UNKNOWN = 0.35  # of an edge, a step or a tint that nothing shows


@dataclass(frozen=True)
class Rectangles:
    """R of them: (R,) lines of the wall's cells between which they lie."""

    left: np.ndarray
    right: np.ndarray
    low: np.ndarray
    high: np.ndarray

    def __len__(self) -> int:
        return len(self.left)

    def of(self, which: np.ndarray) -> Rectangles:
        """Some of them."""
        return Rectangles(self.left[which], self.right[which], self.low[which], self.high[which])

    def shrunk(self, cells: int) -> Rectangles:
        """By so many cells on all sides but the floor's, or by a quarter where they are small."""
        x = np.minimum(cells, (self.right - self.left) // 4)
        z = np.minimum(cells, (self.high - self.low) // 4)
        return Rectangles(self.left + x, self.right - x, np.where(self.low > 0, self.low + z, 0), self.high - z)

    def grown(self, cells: int, shape: tuple[int, int]) -> Rectangles:
        """By so many cells on all sides but the floor's, within the wall."""
        low = np.where(self.low > 0, np.maximum(self.low - cells, 0), 0)
        left, right = np.maximum(self.left - cells, 0), np.minimum(self.right + cells, shape[0])
        return Rectangles(left, right, low, np.minimum(self.high + cells, shape[1]))

    @property
    def width_m(self) -> np.ndarray:
        return (self.right - self.left) * CELL_M

    @property
    def low_m(self) -> np.ndarray:
        return self.low * CELL_M

    @property
    def height_m(self) -> np.ndarray:
        return (self.high - self.low) * CELL_M


@dataclass(frozen=True)
class Signs:
    """What speaks for each of R rectangles, all 0..1 or shares: the columns of `table`.

    Attributes:
        inside: share of the evidence within.
        step: how much less of it is around, mean of the sides.
        edge, worst: strength of the photos' edges along the sides, mean and least.
        frame: strength of a second edge around them, over a half.
        tint: difference of colour to what is around, mean of the sides.
        known: share that photos show.
    """

    inside: np.ndarray
    step: np.ndarray
    edge: np.ndarray
    worst: np.ndarray
    frame: np.ndarray
    tint: np.ndarray
    known: np.ndarray


def candidates(wall: WallMap, evidence: Evidence, on_floor: bool, least: tuple[float, float]) -> Rectangles:
    """All between lines that stand out in the photos or in the evidence.

    Args:
        on_floor: they stand on the floor.
        least: width and height, metres.
    """
    upright = _outstanding(wall.lines[0], evidence.found, evidence.of)
    level = _outstanding(wall.lines[1], evidence.found.T, evidence.of.T)
    x0, x1 = _pairs(upright, least[0])
    z0, z1 = (np.zeros_like(level), level) if on_floor else _pairs(level, least[1])
    tall = (z1 - z0) * CELL_M >= least[1] - 1e-9
    z0, z1 = z0[tall], z1[tall]
    i, j = (places.ravel() for places in np.indices((len(x0), len(z0))))
    return Rectangles(x0[i], x1[i], z0[j], z1[j])


def signs(wall: WallMap, evidence: Evidence, rectangles: Rectangles, rim_m: float = 0.0) -> Signs:
    """What speaks for each rectangle.

    Args:
        rim_m: how far within it the evidence begins: inside a frame.
    """
    found, of = _integral(evidence.found), _integral(evidence.of)
    inner = rectangles.shrunk(round(rim_m / CELL_M))
    inside = _sum(found, inner) / (_sum(of, inner) + SLACK)
    steps = []
    for strip in _strips(rectangles, STRIP_M, wall.shape):
        rays = _sum(of, strip)
        steps.append(np.where(rays >= LEAST_RAYS, inside - _sum(found, strip) / np.maximum(rays, 1e-9), np.nan))
    edges = side_edges(wall, rectangles)
    frames = [side_edges(wall, rectangles.grown(cells, wall.shape)).mean(axis=1) for cells in FRAME_CELLS]
    seen = _integral(wall.known.astype(np.float64))
    area = (rectangles.right - rectangles.left) * (rectangles.high - rectangles.low)
    return Signs(
        inside,
        _known_or_usual(np.stack(steps, axis=1)).mean(axis=1),
        edges.mean(axis=1),
        edges.min(axis=1),
        np.maximum(np.max(frames, axis=0) - 0.5, 0),
        _tints(wall, rectangles, seen).mean(axis=1),
        _sum(seen, rectangles) / np.maximum(area, 1),
    )


def beside(rectangle: Rectangles, shape: tuple[int, int]) -> Rectangles:
    """One rectangle, and all that have one side moved by up to `MOVED_M`."""
    cells = np.array([rectangle.left[0], rectangle.right[0], rectangle.low[0], rectangle.high[0]])
    moves = np.arange(-round(MOVED_M / CELL_M), round(MOVED_M / CELL_M) + 1)
    sides = (0, 1, 3) if cells[2] == 0 else (0, 1, 2, 3)
    moved = np.concatenate([[cells], *(cells + moves[:, None] * np.eye(4, dtype=int)[side] for side in sides)])
    x0, x1, z0, z1 = moved.T
    whole = (x0 >= 0) & (x1 <= shape[0]) & (z0 >= 0) & (z1 <= shape[1]) & (x1 - x0 > 4) & (z1 - z0 > 4)
    return Rectangles(x0, x1, z0, z1).of(whole & ((z0 > 0) == (cells[2] > 0)))


def rim(wall: WallMap, one: Rectangles, framed: bool) -> Rectangles:
    """One rectangle with its sides on the clearest lines; with a frame around it, on the frame's outer edges."""
    upright, level = (np.where(lines.known, lines.strength, 0) for lines in wall.lines)
    left, right, low, high = (int(at[0]) for at in (one.left, one.right, one.low, one.high))
    x, z = slice(left, right), slice(low, high)
    return Rectangles(
        np.array([left - _moved(upright[::-1, z], len(upright) - 1 - left, framed)]),
        np.array([right + _moved(upright[:, z], right, framed)]),
        np.array([low - _moved(level[::-1, x], len(level) - 1 - low, framed) if low > 0 else 0]),
        np.array([high + _moved(level[:, x], high, framed)]),
    )


def _moved(lines: np.ndarray, at: int, framed: bool) -> int:
    """By how many lines a side is moved outwards, which is where the numbers rise.

    To the clearest line beside it; from there, to the last one within `MOST_FRAME_M` that is nearly as clear.
    """
    clear = lines.mean(axis=1)
    near = np.arange(max(at - 1, 0), min(at + 2, len(clear)))
    start = int(near[clear[near].argmax()])
    if not framed:
        return start - at
    padded = np.pad(clear, 1, constant_values=-1.0)
    peak = (clear >= CLEAR * clear[start]) & (clear >= padded[:-2]) & (clear > padded[2:])
    outer = np.flatnonzero(peak[start : start + round(MOST_FRAME_M / CELL_M) + 1])
    return start + int(outer[-1]) - at if len(outer) else start - at


def _outstanding(lines: Lines, found: np.ndarray, of: np.ndarray) -> np.ndarray:
    """Numbers of the lines that stand out most over a piece of their length, and of the first and the last."""
    evened = [ndimage.uniform_filter(part.astype(np.float64), SMOOTH, mode="constant") for part in (found, of)]
    share = np.where(evened[1] > 1e-9, evened[0] / np.maximum(evened[1], 1e-9), 0)
    padded = np.pad(share, ((1, 1), (0, 0)), mode="edge")
    step = np.abs(np.diff(padded, axis=0))
    chosen = {0, len(lines.strength) - 1}
    for values, count in ((lines.strength, EDGE_LINES), (step, STEP_LINES)):
        most = ndimage.uniform_filter1d(values, max(1, round(PIECE_M / CELL_M)), axis=1, mode="constant").max(axis=1)
        peak = np.nonzero((most == ndimage.maximum_filter1d(most, 3)) & (most > 0.02))[0]
        chosen |= set(peak[np.argsort(-most[peak], kind="stable")][:count].tolist())
    return np.array(sorted(chosen))


def _pairs(lines: np.ndarray, least_m: float) -> tuple[np.ndarray, np.ndarray]:
    one, other = np.triu_indices(len(lines), 1)
    wide = (lines[other] - lines[one]) * CELL_M >= least_m - 1e-9
    return lines[one[wide]], lines[other[wide]]


def _integral(values: np.ndarray) -> np.ndarray:
    whole = np.zeros((values.shape[0] + 1, values.shape[1] + 1, *values.shape[2:]))
    whole[1:, 1:] = values.cumsum(axis=0).cumsum(axis=1)
    return whole


def _sum(integral: np.ndarray, r: Rectangles) -> np.ndarray:
    return integral[r.right, r.high] - integral[r.left, r.high] - integral[r.right, r.low] + integral[r.left, r.low]


def _strips(r: Rectangles, wide_m: float, shape: tuple[int, int]) -> list[Rectangles]:
    """Left of each, right of it, above and, of those that do not stand on the floor, below it (or what is empty)."""
    cells = round(wide_m / CELL_M)
    return [
        Rectangles(np.maximum(r.left - cells, 0), r.left, r.low, r.high),
        Rectangles(r.right, np.minimum(r.right + cells, shape[0]), r.low, r.high),
        Rectangles(r.left, r.right, r.high, np.minimum(r.high + cells, shape[1])),
        *([Rectangles(r.left, r.right, np.maximum(r.low - cells, 0), r.low)] if r.low.any() else []),
    ]


def side_edges(wall: WallMap, r: Rectangles) -> np.ndarray:
    """(R, 3 or 4) mean strength along the sides, as `_strips` has them."""
    upright, level = (_along(lines) for lines in wall.lines)
    sides = [_mean(upright, r.left, r.low, r.high), _mean(upright, r.right, r.low, r.high)]
    sides.append(_mean(level, r.high, r.left, r.right))
    if r.low.any():
        sides.append(_mean(level, r.low, r.left, r.right))
    return _known_or_usual(np.stack(sides, axis=1))


def _along(lines: Lines) -> tuple[np.ndarray, np.ndarray]:
    """Sums along each line, of its strength or that of a line beside it, and of where it is known."""
    strength = ndimage.maximum_filter1d(lines.strength, 3, axis=0) * lines.known
    sums = [np.pad(part.cumsum(axis=1), ((0, 0), (1, 0))) for part in (strength, lines.known.astype(np.float64))]
    return sums[0], sums[1]


def _mean(sums: tuple[np.ndarray, np.ndarray], line: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Of what is known of a piece of a line; NaN where that is less than a tenth of it."""
    total, known = (part[line, end] - part[line, start] for part in sums)
    return np.where(known > 0.1 * (end - start), total / np.maximum(known, 1e-9), np.nan)


def _tints(wall: WallMap, rectangles: Rectangles, seen: np.ndarray) -> np.ndarray:
    """(R, 3 or 4) how far the colour within is from that around."""
    color = _integral(wall.color * wall.known[..., None])

    def mean(of: Rectangles) -> tuple[np.ndarray, np.ndarray]:
        count = _sum(seen, of)
        return _sum(color, of) / np.maximum(count, 1e-9)[:, None], count

    within, _ = mean(rectangles)
    sides = []
    for strip in _strips(rectangles, TINT_M, wall.shape):
        around, count = mean(strip)
        contrast = np.linalg.norm(around - within, axis=1)
        sides.append(np.where(count >= LEAST_RAYS, contrast / (contrast + TINT), np.nan))
    return _known_or_usual(np.stack(sides, axis=1))


def _known_or_usual(values: np.ndarray) -> np.ndarray:
    return np.where(np.isnan(values), UNKNOWN, values)
