"""Random floor plans and ceilings."""

from __future__ import annotations

import numpy as np


def random_outline(rng: np.random.Generator) -> np.ndarray:
    """(N, 2) floor plan: a rectangle, an L, a T, with an alcove, a nose or a cut corner; 2 to 9 m a side."""
    small = rng.random() < 0.2
    width, depth = rng.uniform(1.6, 3.2, 2) if small else rng.uniform(2.6, 6.0, 2)
    if rng.random() < 0.15:
        width, depth = width * rng.uniform(1.2, 1.7), depth * rng.uniform(1.0, 1.6)
    if rng.random() < 0.08:  # a corridor
        width, depth = rng.uniform(1.1, 1.8), rng.uniform(4.0, 8.0)
    w, d = float(width), float(depth)
    kind = rng.random()
    if kind < 0.50 or min(w, d) < 2.2:
        corners = [(0, 0), (w, 0), (w, d), (0, d)]
    elif kind < 0.68:  # L
        a, b = w * rng.uniform(0.35, 0.7), d * rng.uniform(0.35, 0.7)
        corners = [(0, 0), (w, 0), (w, b), (a, b), (a, d), (0, d)]
    elif kind < 0.80:  # alcove in the wall y = d
        a, b = w * rng.uniform(0.1, 0.35), w * rng.uniform(0.6, 0.9)
        deep = rng.uniform(0.3, 1.4)
        corners = [(0, 0), (w, 0), (w, d), (b, d), (b, d + deep), (a, d + deep), (a, d), (0, d)]
    elif kind < 0.90:  # a chimney breast or a duct that juts into the room
        a = w * rng.uniform(0.2, 0.6)
        b, deep = a + rng.uniform(0.3, 0.3 * w), rng.uniform(0.15, 0.6)
        corners = [(0, 0), (w, 0), (w, d), (b, d), (b, d - deep), (a, d - deep), (a, d), (0, d)]
    else:  # a cut corner
        a, b = rng.uniform(0.4, 0.5 * w), rng.uniform(0.4, 0.5 * d)
        corners = [(0, 0), (w, 0), (w, d - b), (w - a, d), (0, d)]
    outline = np.array(corners, float)
    if rng.random() < 0.5:
        outline = (outline * (-1, 1))[::-1]
    if rng.random() < 0.5:
        outline = (outline * (1, -1))[::-1]
    if rng.random() < 0.5:
        outline = outline @ np.array([[0.0, 1.0], [-1.0, 0.0]])
    return outline - outline.min(axis=0)


def random_profile(rng: np.random.Generator, depth: float) -> np.ndarray:
    """(K, 2) ceiling heights along y: mostly flat, else an attic's slopes or a vault."""
    height = float(np.clip(rng.normal(2.6, 0.25), 2.2, 3.6))
    kind = rng.random()
    if kind < 0.84 or depth < 2.0:
        return np.array([(-1e3, height), (1e3, height)])
    low = rng.uniform(0.5, 1.9)
    run = float(np.clip((height - low) / np.tan(rng.uniform(0.45, 1.05)), 0.4, 0.9 * depth))
    if kind < 0.93:
        rows = [(0.0, low), (run, height), (depth, height)]
    elif kind < 0.98:
        run = min(run, 0.5 * depth)
        rows = [(0.0, low), (run, height), (depth - run, height), (depth, low)]
        rows = rows if depth - 2 * run > 0.01 else [rows[0], rows[1], rows[3]]
    else:
        y = np.linspace(0, depth, 13)
        rise = rng.uniform(0.2, 0.7)
        rows = list(zip(y, height - rise + rise * np.sin(np.pi * y / depth), strict=True))
    profile = np.array(rows)
    if rng.random() < 0.5:
        profile = np.column_stack([depth - profile[::-1, 0], profile[::-1, 1]])
    return profile
