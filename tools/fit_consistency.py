"""Fits calibrated consistency (`room2dgs.stereo.consistency`) to captures whose depth is known.

    python -m room2dgs.tools.fit_consistency CAPTURE ...

A depth is wrong when it is more than 5 cm off. Printed are, for each capture, how well its wrong depths are told from
the right ones (area under the curve) by the number of consistent views alone, by the weights that the package has, and
by weights that are fitted to the other captures; then the weights fitted to all of them.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.special import expit
from scipy.stats import rankdata

from room2dgs.captures.read import read_scene
from room2dgs.config import load_config
from room2dgs.errors import InputError
from room2dgs.sfm.sparse import sparse_points
from room2dgs.stereo.consistency import ALL_EVIDENCE, consistency_evidence
from room2dgs.stereo.passes import FIRST_WIDTH, NARROWER, with_windows
from room2dgs.stereo.scene import scene_neighbours, scene_stereo
from room2dgs.tools.command_line import command_line
from room2dgs.tools.stereo_check.scores import true_depth

WRONG_M = 0.05
STEPS = 25  # of Newton's method; a handful do
RIDGE = 1e-6  # keeps it finite where evidence never changes


class Pixels(NamedTuple):
    """Depth of stereo whose truth is known.

    Attributes:
        evidence: (N, 5), as `room2dgs.stereo.consistency.consistency_evidence` has it.
        wrong: (N,) bool.
    """

    evidence: np.ndarray
    wrong: np.ndarray


def gathered(capture: Path, scratch: Path) -> Pixels:
    """The pixels of a capture's training views, compared as in a first pass.

    Raises:
        InputError: the capture has no depth, or as `read_scene` and `sparse_points`.
    """
    config = load_config([f"scene.path={capture}", "out=unused"])
    scene = read_scene(config.scene)
    if not any(frame.depth_path for frame in scene.train):
        raise InputError(f"{capture} has no depth to measure against; add a depth folder")
    points = sparse_points(scene, config.points, scratch)
    settings = replace(with_windows(config.stereo, NARROWER), width=FIRST_WIDTH)
    cameras, found = scene_stereo(scene.train, points, settings)
    views = list(found)
    near = scene_neighbours(scene.train, cameras, points, settings.consistency_views)
    parts = []
    for frame, camera, view, beside in zip(scene.train, cameras, views, near, strict=True):
        others = [(cameras[other], views[other].depth) for other in beside]
        maps = consistency_evidence(
            (camera, view.depth),
            view.num_consistent,
            others,
            settings.max_reprojection_px,
            settings.max_relative_difference,
        )
        truth = true_depth(frame, camera)
        here = (truth > 0) & (view.depth > 0)
        wrong = np.abs(view.depth - truth)[here] > WRONG_M
        parts.append(Pixels(np.stack([part[here] for part in maps], axis=1).astype(np.float32), wrong))
    return Pixels(*(np.concatenate(part) for part in zip(*parts, strict=True)))


def fitted(pixels: Sequence[Pixels], columns: int) -> np.ndarray:
    """(1 + columns,) weights of the log odds that a depth is wrong: a constant, then of the first columns.

    Logistic regression; every capture counts the same, however many pixels it has.
    """
    weights = np.zeros(1 + columns)
    parts = [(_with_constant(one.evidence[:, :columns]), one.wrong) for one in pixels]
    for _ in range(STEPS):
        gradient, curvature = -RIDGE * weights, RIDGE * np.eye(1 + columns)
        for known, wrong in parts:
            probable = expit(known @ weights)
            gradient += known.T @ (wrong - probable) / len(wrong)
            curvature += (known * (probable * (1 - probable))[:, None]).T @ known / len(wrong)
        weights += np.linalg.solve(curvature, gradient)
    return weights


def area(odds: np.ndarray, wrong: np.ndarray) -> float:
    """Area under the curve: how often a wrong depth has higher odds than a right one, ties by halves; else NaN."""
    bad = np.count_nonzero(wrong)
    good = len(wrong) - bad
    if not bad * good:
        return float("nan")
    return float((rankdata(odds)[wrong].sum() - bad * (bad + 1) / 2) / (bad * good))


def odds(weights: Sequence[float] | np.ndarray, pixels: Pixels) -> np.ndarray:
    """(N,) log odds that a depth is wrong."""
    return _with_constant(pixels.evidence[:, : len(weights) - 1]) @ np.asarray(weights)


def _with_constant(columns: np.ndarray) -> np.ndarray:
    return np.concatenate([np.ones((len(columns), 1)), columns], axis=1)


@command_line("fit_consistency")
def main(arguments: list[str]) -> None:
    """The command line."""
    parser = argparse.ArgumentParser(prog="fit_consistency", description="Fit calibrated consistency of stereo.")
    parser.add_argument("captures", type=Path, nargs="+", help="folders of captures with depth")
    paths = parser.parse_args(arguments).captures
    with tempfile.TemporaryDirectory() as scratch:
        every = [gathered(path, Path(scratch)) for path in paths]
    columns = len(ALL_EVIDENCE) - 1
    print(f"{'capture':<20} {'wrong':>6} {'views':>6} {'today':>6} {'others':>6}")
    for path, one in zip(paths, every, strict=True):
        others = [other for other in every if other is not one]
        of_others = area(odds(fitted(others, columns), one), one.wrong) if others else float("nan")
        alone, today = area(-one.evidence[:, 0], one.wrong), area(odds(ALL_EVIDENCE, one), one.wrong)
        print(f"{path.name:<20} {one.wrong.mean():6.3f} {alone:6.3f} {today:6.3f} {of_others:6.3f}")
    for name, count in (("ALONE", 1), ("ALL_EVIDENCE", columns)):
        print(f"{name}: {', '.join(f'{weight:.3f}' for weight in fitted(every, count))}")


if __name__ == "__main__":
    sys.exit(main())
