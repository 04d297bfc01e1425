"""Lengths between points and planes, with what each rests on."""

from __future__ import annotations

import numpy as np

from room2dgs.errors import InputError
from room2dgs.lengths.correlation import correlation
from room2dgs.lengths.length import Length
from room2dgs.lengths.surface import FoundPlane, Spot

PARALLEL_DEG = 5.0
ONE_SURFACE = 0.9  # cosine: errors of surfaces that face the same way hang together


def point_to_point(one: Spot, other: Spot, scale: float, step_m: float) -> Length:
    """From point to point, straight.

    Along a surface's normal a point is off by the surface's error, across it by half a step of the mesh.

    Args:
        scale: relative deviation of the run's scale.
        step_m: how finely the mesh was made.

    Raises:
        InputError: both are the same point.
    """
    along = other.point - one.point
    value = float(np.linalg.norm(along))
    if not value > 0:
        raise InputError("both points are the same; pick two")
    along = along / value
    first, second = one.sigma_m * (one.normal @ along), other.sigma_m * (other.normal @ along)
    alike = one.normal @ other.normal > ONE_SURFACE
    shared = correlation(np.stack([one.point, other.point]))[0, 1] if alike else 0.0
    surface = np.sqrt(max(0.0, first**2 + second**2 - 2 * shared * first * second))
    across = [np.sqrt(max(0.0, 1 - float(spot.normal @ along) ** 2)) for spot in (one, other)]
    fit = float(np.hypot(*across)) * step_m / 2
    return Length(value, float(surface), fit, scale * value, "two points of the mesh")


def point_to_plane(spot: Spot, plane: FoundPlane, scale: float) -> Length:
    """Square to the plane."""
    value = abs(float(plane.normal @ spot.point) - plane.offset_m)
    surface = np.hypot(spot.sigma_m * float(plane.normal @ spot.normal), plane.sigma.surface_m)
    return Length(value, float(surface), plane.sigma.fit_m, scale * value, f"a point and {_words(plane)}")


def plane_to_plane(one: FoundPlane, other: FoundPlane, scale: float) -> Length:
    """Between parallel planes, in the middle between them.

    Raises:
        InputError: they are not parallel.
    """
    angle = angle_deg(one, other)
    if angle > PARALLEL_DEG:
        raise InputError(
            f"{one.name} and {other.name} are {angle:.0f} degrees from parallel and have no one distance; measure from "
            "a point instead"
        )
    sign = 1.0 if one.normal @ other.normal > 0 else -1.0
    across = one.normal + sign * other.normal
    across /= np.linalg.norm(across)
    middle = (one.middle + other.middle) / 2
    # along `across` from the middle to each plane
    first, second = ((plane.offset_m - plane.normal @ middle) / float(plane.normal @ across) for plane in (one, other))
    value = abs(float(first - second))
    surface = np.hypot(one.sigma.surface_m, other.sigma.surface_m)
    fit = np.hypot(one.sigma.fit_m, other.sigma.fit_m)
    return Length(value, float(surface), float(fit), scale * value, f"{_words(one)} and {_words(other)}")


def angle_deg(one: FoundPlane, other: FoundPlane) -> float:
    """0 to 90, between two planes."""
    return float(np.degrees(np.arccos(np.clip(abs(one.normal @ other.normal), 0, 1))))


def _words(plane: FoundPlane) -> str:
    return f"{plane.name} ({plane.sigma.area_m2:.1f} m² of the mesh)"
