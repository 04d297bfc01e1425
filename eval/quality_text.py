"""The figures of `mesh_quality` in words, for a terminal and for a page."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

# figure -> label, and how its value is written
ROWS: dict[str, tuple[str, Callable[[float], str]]] = {
    "tears_per_m": ("tears: open boundary where surface goes on", lambda x: f"{x:.2f} m per m²"),
    "pieces": ("pieces", lambda x: f"{x:,.0f}"),
    "islands": ("area outside the largest piece", lambda x: f"{x:.1%}"),
    "coverage": ("pixels covered", lambda x: f"{x:.1%}"),
    "coverage_known": ("pixels of known depth covered", lambda x: f"{x:.1%}"),
    "in_free_space": ("area in free space", lambda x: f"{x:.2%}"),
    "roughness_2cm_deg": ("roughness of flat parts at 2 cm", lambda x: f"{x:.1f}°"),
    "roughness_10cm_deg": ("roughness of flat parts at 10 cm", lambda x: f"{x:.1f}°"),
    "crease_error_m": ("error beside creases", lambda x: f"{x * 1000:.1f} mm"),
    "crease_missing": ("missing beside creases", lambda x: f"{x:.1%}"),
}
HOLE_WORDS = "holes {}"


def rows(figures: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Label and value of each figure that is known, holes by their size."""
    found = [(label, text(value)) for key, (label, text) in ROWS.items() if (value := figures.get(key)) is not None]
    holes = [
        (HOLE_WORDS.format(size.replace("_", " ").replace("cm", " cm")), f"{count:,}")
        for size, count in (figures.get("holes") or {}).items()
    ]
    return [*found[:1], *holes, *found[1:]]


def sentence(figures: Mapping[str, Any]) -> str:
    """All of them in a line."""
    return "how whole the mesh is: " + "; ".join(f"{label} {value}" for label, value in rows(figures))
