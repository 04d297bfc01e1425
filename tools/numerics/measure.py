"""All hard cases measured: rows of plain numbers, and whether each is within its bound."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from room2dgs.tools.numerics.alternatives import choices
from room2dgs.tools.numerics.compare import compare, large
from room2dgs.tools.numerics.gaussians import GAUSSIAN_SCENES
from room2dgs.tools.numerics.invariances import invariances
from room2dgs.tools.numerics.scenes import ILL_CONDITIONED, LARGE, SCENES, four_k
from room2dgs.tools.numerics.stages import STAGES
from room2dgs.tools.numerics.terms import TERMS, compare_term

Row = dict[str, Any]
ALL_SCENES = SCENES | GAUSSIAN_SCENES
SIDE_BY_SIDE_PAIRS = 10**6  # of surfels and pixels; more take gigabytes


def raster_row(name: str) -> Row:
    """One scene: images and gradients against float64, invariances, the forms that we do not use."""
    scene = ALL_SCENES[name]()
    found, still = compare(scene, name in ILL_CONDITIONED), invariances(scene)
    row: Row = {
        "case": name, "size": f"{scene.width}x{scene.height}", "surfels": len(scene.surfels.centers),
        "images": found.images, "gradients": found.gradients, "left_out": found.left_out, "bound": found.bound,
        "finite": found.finite, "invariances": still._asdict(),
    }  # fmt: skip
    row["passed"] = found.passed and still.within(found.bound)
    pairs = len(scene.surfels.centers) * scene.width * scene.height
    if name in SCENES and pairs < SIDE_BY_SIDE_PAIRS and (other := choices(scene)):
        row["forms"] = other._asdict()
    return row


def large_row() -> Row:
    """The 4K picture, in windows."""
    scene = four_k()
    found = large(scene)
    return {
        "case": LARGE, "size": f"{scene.width}x{scene.height}", "surfels": len(scene.surfels.centers),
        "images": found.images, "gradients": found.gradients, "left_out": found.left_out, "bound": found.bound,
        "finite": found.finite, "passed": found.passed,
    }  # fmt: skip


def term_row(name: str) -> Row:
    """One case of a loss term."""
    found = compare_term(TERMS[name])
    return {"case": name, **found._asdict(), "passed": found.passed}


def stage_row(name: str) -> Row:
    """One case of a stage before training."""
    found = STAGES[name]()
    return {"case": name, **found._asdict(), "passed": found.passed}


def measured(only: str = "", quick: bool = False, tell: Callable[[str], None] = lambda _: None) -> dict[str, list[Row]]:
    """Rows of every kind.

    Args:
        only: cases whose name has this in it.
        quick: without the 4K picture.
        tell: gets the name of each case before it runs.
    """
    kinds: tuple[tuple[str, Any, Callable[[str], Row]], ...] = (
        ("raster", ALL_SCENES, raster_row), ("terms", TERMS, term_row), ("stages", STAGES, stage_row),
    )  # fmt: skip
    found: dict[str, list[Row]] = {}
    for kind, names, row_of in kinds:
        found[kind] = []
        for name in names:
            if only in name:
                tell(name)
                found[kind].append(row_of(name))
    if not quick and only in LARGE:
        tell(LARGE)
        found["raster"].append(large_row())
    return found
