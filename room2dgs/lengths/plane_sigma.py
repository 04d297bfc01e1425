"""How sure the place of a plane is that was fitted to a mesh's faces."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from room2dgs.geometry.cells import cell_indices
from room2dgs.lengths.correlation import CELL_M, mean_sigma
from room2dgs.lengths.surface_error import face_weight

NORMAL_DEG, BAND_M = 20.0, 0.04  # faces of a plane
LEAST_CELLS = 4  # fewer do not tell how uneven a surface is


class Faces(NamedTuple):
    """Of a mesh, F of them, in any one frame.

    Attributes:
        middle, normal: (F, 3) metres; unit.
        area: (F,) square metres.
        sigma_m: (F,) expected error along the normal.
    """

    middle: np.ndarray
    normal: np.ndarray
    area: np.ndarray
    sigma_m: np.ndarray

    @property
    def weight(self) -> np.ndarray:
        """(F,) of each in the place of a plane."""
        return face_weight(self.area, self.sigma_m)

    def of(self, which: np.ndarray) -> Faces:
        return Faces(self.middle[which], self.normal[which], self.area[which], self.sigma_m[which])


class PlaneSigma(NamedTuple):
    """Standard deviations of a plane's offset, metres.

    Attributes:
        surface_m: by the expected errors of its faces, correlated over the surface.
        fit_m: by how uneven the faces lie about it, as its cells show.
        area_m2: of the faces that it rests on.
    """

    surface_m: float
    fit_m: float
    area_m2: float

    @property
    def sigma_m(self) -> float:
        return float(np.hypot(self.surface_m, self.fit_m))


UNKNOWN = PlaneSigma(0.05, 0.0, 0.0)  # of a plane without faces


def faces_on(faces: Faces, normal: np.ndarray, offset_m: float) -> np.ndarray:
    """Indices of the faces that lie on a plane: near it, and turned as it is."""
    near = np.abs(faces.middle @ normal - offset_m) < BAND_M
    return np.flatnonzero(near & (faces.normal @ normal > np.cos(np.radians(NORMAL_DEG))))


def plane_sigma(faces: Faces, normal: np.ndarray, offset_m: float) -> PlaneSigma:
    """Of a plane whose offset is the median of its faces by their weight.

    It is that of their mean by area, which bounds it: the surest faces share what the whole surface is off by.

    Args:
        faces: all of the mesh, or those around the plane.
        normal: (3,) unit; normal @ point = offset_m.
    """
    on = faces.of(faces_on(faces, normal, offset_m))
    if not len(on.area):
        return UNKNOWN
    cell = np.unique(cell_indices(on.middle, CELL_M), axis=0, return_inverse=True)[1].ravel()
    area = np.bincount(cell, on.area)
    place = np.stack([np.bincount(cell, on.area * part) / area for part in on.middle.T], axis=1)
    sigma_m = np.bincount(cell, on.area * on.sigma_m) / area
    off = np.bincount(cell, on.area * (on.middle @ normal - offset_m)) / area
    surface_m = mean_sigma(place, sigma_m, area)
    fit_m = 0.0
    if len(area) >= LEAST_CELLS:
        spread = float(np.sqrt(np.average(off**2, weights=area)))
        fit_m = mean_sigma(place, np.full(len(area), spread), area)
    return PlaneSigma(surface_m, fit_m, float(area.sum()))
