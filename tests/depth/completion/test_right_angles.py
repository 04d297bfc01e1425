"""Directions of planes: how well they are known, and how they are adjusted to each other."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from room2dgs.depth.completion.planes import Samples, find_planes
from room2dgs.depth.completion.right_angles import (
    DOUBTFUL_DEG,
    EXACT_DEG,
    LEAST_ERROR_DEG,
    MOST_DOUBT_DEG,
    UNKNOWN_DEG,
    direction_covariance,
    turned,
)

UP = np.array([0.0, 0.0, 1.0])
X, Y = np.eye(3)[:2]


def leaning(normal, about, degrees):
    return Rotation.from_rotvec(np.radians(degrees) * np.asarray(about, float)).apply(normal)


def known_to(normal, degrees):
    """The same in all directions."""
    return np.radians(degrees) ** 2 * (np.eye(3) - np.outer(normal, normal))


def degrees_between(a, b):
    return float(np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b)))


def all_turned(planes):
    normals = np.stack([normal for normal, _ in planes])
    return turned(normals, np.stack([known_to(*plane) for plane in planes]))


def test_a_floor_that_is_badly_known_stands_upright_on_walls_that_are_well_known():
    floor = leaning(UP, [0.6, 0.8, 0], 3)
    found = all_turned([(floor, 4.0), (X, 0.3), (Y, 0.3), (-X, 0.4)])
    assert degrees_between(found[0], UP) < 0.4
    assert np.abs(found[1:] - [X, Y, -X]).max() < 1e-3  # and the walls do not follow it


def test_a_curtain_that_is_known_to_lean_goes_on_leaning():
    curtain = leaning(X, Y, 3)
    found = all_turned([(curtain, 0.4), (UP, 0.3), (Y, 0.3), (-X, 0.3)])
    assert degrees_between(found[0], X) > 2.7


@pytest.mark.parametrize("angle", [20, 45, 70])
def test_other_angles_stay(angle):
    roof = leaning(UP, X, angle)
    found = all_turned([(roof, 2.0), (UP, 0.3), (Y, 0.3)])
    assert degrees_between(found[0], roof) < 0.3


def test_parallel_planes_become_so_whichever_way_they_face():
    for facing in (1, -1):
        table = facing * leaning(UP, X, 2)
        assert degrees_between(all_turned([(table, 3.0), (UP, 0.3)])[0], facing * UP) < 0.2


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_the_last_plane_takes_the_most_probable_direction(seed):
    """Against scipy, which minimises the same energy from the same start."""
    rng = np.random.default_rng(seed)
    frame = Rotation.random(random_state=seed % 2**31).as_matrix()
    sure = [frame[0], frame[1]]
    normal = leaning(frame[2], frame.T @ [0.6, 0.8, 0], rng.uniform(-4, 4))
    axes = np.linalg.svd(normal[None])[2][1:]
    covariance = axes.T @ np.diag(np.radians(rng.uniform(1.5, 4, 2)) ** 2) @ axes
    covariances = np.stack([known_to(sure[0], 0.3), known_to(sure[1], 0.4), covariance])
    found = turned(np.stack([*sure, normal]), covariances)[2]
    doubtful = np.radians(DOUBTFUL_DEG) ** 2

    def placed(slope):
        moved = normal + slope @ axes
        return moved / np.linalg.norm(moved)

    def energy(slope):
        one, total = placed(slope), slope @ np.linalg.inv(axes @ covariance @ axes.T) @ slope
        for other, degrees in zip(sure, (0.3, 0.4), strict=True):
            way = other - (one @ other) * one
            way /= np.linalg.norm(way)
            its = np.radians(degrees) ** 2
            width = doubtful + min(way @ covariance @ way + its, np.radians(MOST_DOUBT_DEG) ** 2)
            off2 = (one @ other) ** 2
            total += off2 / (1 + off2 / width) / (np.radians(EXACT_DEG) ** 2 + its)
        return total

    reference = placed(minimize(energy, np.zeros(2), method="Nelder-Mead", options={"xatol": 1e-7, "fatol": 1e-9}).x)
    assert degrees_between(found, reference) < 0.05


def cloth(rng, waves, count=4000):
    """A wall of 3 m at x = 0, its surface before and behind it by turns."""
    flat = rng.uniform(-1.5, 1.5, (count, 2))
    off = waves * np.sin(3 * flat[:, 0] + 1) * np.cos(2.5 * flat[:, 1]) + rng.normal(0, 0.01, count)
    return np.column_stack([off, flat]), off


def test_the_more_a_surface_waves_the_less_its_direction_is_known():
    waving = []
    for waves in (0.0, 0.04, 0.08):
        xyz, off = cloth(np.random.default_rng(0), waves)
        covariance = direction_covariance(xyz, off, np.ones(len(xyz)), X)
        assert np.allclose(covariance @ X, 0, atol=1e-12) and np.allclose(covariance, covariance.T)
        waving.append(np.degrees(np.sqrt(np.linalg.eigvalsh(covariance)[1:] - np.radians(LEAST_ERROR_DEG) ** 2)))
    assert waving[0].max() < 0.5 and waving[1].min() > 1
    assert np.allclose(waving[2] / waving[1], 2, atol=0.1)


def test_a_strip_is_known_along_itself_and_not_across():
    rng = np.random.default_rng(0)
    xyz = np.column_stack([np.zeros(3000), rng.uniform(-3, 3, 3000), rng.uniform(-0.15, 0.15, 3000)])
    xyz[:, 0] += 0.02 * np.sin(9 * xyz[:, 1])
    covariance = direction_covariance(xyz, xyz[:, 0], np.ones(3000), X)
    assert UP @ covariance @ UP > 10 * (Y @ covariance @ Y)


@pytest.mark.parametrize("shape", ["one cell", "a line", "one point"])
def test_what_too_little_speaks_of_is_unknown(shape):
    spread = np.random.default_rng(0).uniform(0.1, 0.5, (500, 3))
    spread = {"one cell": spread * [0, 1, 1], "a line": spread * [0, 0, 20], "one point": spread * 0}[shape]
    covariance = direction_covariance(spread, np.zeros(500), np.ones(500), X)
    assert np.degrees(np.sqrt(Y @ covariance @ Y)) == pytest.approx(UNKNOWN_DEG)


def test_planes_found_in_samples_are_squared_only_when_asked():
    """A floor that was seen wavy and 1.5 degrees off, between three walls that were seen well."""
    rng = np.random.default_rng(0)
    parts = []
    for normal, count, waves in ((leaning(UP, X, 1.5), 6000, 0.05), (X, 4000, 0), (Y, 4000, 0), (-X, 4000, 0)):
        across = np.linalg.svd(normal[None])[2][1:]
        flat = rng.uniform(-1.5, 1.5, (count, 2))
        off = waves * np.sin(3 * flat[:, :1] + 1) * np.cos(2.5 * flat[:, 1:])
        xyz = flat @ across + off * normal - 1.5 * normal
        parts.append(
            Samples(xyz, np.broadcast_to(normal, xyz.shape), np.full(count, 2.0), np.ones(count), np.full(count, 0.01))
        )
    samples = Samples(*(np.concatenate(one) for one in zip(*parts, strict=True)))
    as_seen, squared = (find_planes(samples, right_angles=one)[0] for one in (False, True))
    assert degrees_between(as_seen.normal, UP) > 1.3
    assert degrees_between(squared.normal, UP) < 0.6 * degrees_between(as_seen.normal, UP)
    assert squared.offset == pytest.approx(-1.5, abs=0.01) and squared.share == as_seen.share
