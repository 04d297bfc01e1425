"""A mesh to measure on: where rays meet it, what lies nearest, which plane is around a point."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import trimesh

from room2dgs.errors import InputError
from room2dgs.geometry.weighted_quantile import weighted_quantile
from room2dgs.lengths.plane_sigma import Faces, PlaneSigma, faces_on, plane_sigma
from room2dgs.mesh.open3d import o3c_tensor

NEAR_M = 0.1  # of the mesh: what is picked farther off is not on it
AROUND_M = 0.6  # of a picked point: what its plane is found on
CALM_M = 0.12  # of it: whose mean normal is the first guess


@dataclass(frozen=True)
class Spot:
    """A point of the mesh, scene's frame.

    Attributes:
        point, normal: (3,) metres; unit.
        sigma_m: expected error along the normal.
    """

    point: np.ndarray
    normal: np.ndarray
    sigma_m: float


@dataclass(frozen=True)
class FoundPlane:
    """A plane of the mesh: normal @ point = offset_m.

    Attributes:
        middle: (3,) of its faces.
        name: as it was asked for.
    """

    normal: np.ndarray
    offset_m: float
    middle: np.ndarray
    sigma: PlaneSigma
    name: str


@dataclass(frozen=True)
class MeasuredMesh:
    """A mesh with the expected errors of its faces.

    Attributes:
        mesh: scene's frame, metres.
        sigma_m: (F,) of its faces, along their normals.
        step_m: how finely it was made (its voxels).
    """

    mesh: trimesh.Trimesh
    sigma_m: np.ndarray
    step_m: float

    @cached_property
    def faces(self) -> Faces:
        return Faces(
            np.asarray(self.mesh.triangles_center, np.float64),
            np.asarray(self.mesh.face_normals, np.float64),
            np.asarray(self.mesh.area_faces, np.float64),
            self.sigma_m,
        )

    @cached_property
    def _rays(self) -> Any:
        import open3d as o3d

        scene = o3d.t.geometry.RaycastingScene()
        scene.add_triangles(
            o3c_tensor(np.ascontiguousarray(self.mesh.vertices, np.float32)),
            o3c_tensor(np.ascontiguousarray(self.mesh.faces, np.uint32)),
        )
        return scene

    def nearest(self, point: np.ndarray, text: str) -> Spot:
        """The mesh at a picked point.

        Raises:
            InputError: it is farther than `NEAR_M` off.
        """
        found = self._rays.compute_closest_points(o3c_tensor(np.asarray(point, np.float32)[None]))
        on = found["points"].numpy()[0].astype(np.float64)
        off = float(np.linalg.norm(on - point))
        if off > NEAR_M:
            raise InputError(f"{text} is {off:.2f} m off the mesh; pick a point on it")
        return self._spot(np.asarray(point, np.float64), int(found["primitive_ids"].numpy()[0]))

    def hit(self, origin: np.ndarray, direction: np.ndarray, text: str) -> Spot:
        """Where a ray first meets the mesh.

        Raises:
            InputError: nowhere.
        """
        length = np.linalg.norm(direction)
        ray = np.concatenate([origin, direction / length]).astype(np.float32)
        found = self._rays.cast_rays(o3c_tensor(ray[None]))
        away = float(found["t_hit"].numpy()[0])
        if not np.isfinite(away):
            raise InputError(f"{text} shows no surface of the mesh; pick another pixel")
        return self._spot(origin + away * direction / length, int(found["primitive_ids"].numpy()[0]))

    def plane_around(self, spot: Spot, name: str) -> FoundPlane:
        """The plane of the surface around a point."""
        faces = self.faces
        away = np.linalg.norm(faces.middle - spot.point, axis=1)
        around = np.flatnonzero(away < max(AROUND_M, 4 * self.step_m))
        local = faces.of(around)
        calm = (local.area * (away[around] < max(CALM_M, 2 * self.step_m)))[:, None] * local.normal
        alike = local.normal @ spot.normal > 0.5
        normal = calm[alike].sum(axis=0)
        size = float(np.linalg.norm(normal))
        normal = normal / size if size > 0 else spot.normal
        offset_m = float(normal @ spot.point)
        for _ in range(4):
            on = local.of(faces_on(local, normal, offset_m))
            if len(on.area) < 3 or not on.area.sum() > 0:
                break
            normal, offset_m = _fitted(on, normal)
        on = local.of(faces_on(local, normal, offset_m))
        middle = np.average(on.middle, axis=0, weights=on.area) if on.area.sum() > 0 else spot.point
        return FoundPlane(normal, offset_m, middle, plane_sigma(local, normal, offset_m), name)

    def _spot(self, point: np.ndarray, face: int) -> Spot:
        return Spot(point, self.faces.normal[face], float(self.sigma_m[face]))


def _fitted(on: Faces, normal: np.ndarray) -> tuple[np.ndarray, float]:
    """Normal and offset of the plane through faces: as it lies over all their area, where they are surest."""
    off = on.middle - np.average(on.middle, axis=0, weights=on.area)
    found = np.linalg.eigh((off * on.area[:, None]).T @ off)[1][:, 0]
    found = found if found @ normal > 0 else -found
    if found @ normal < np.cos(np.radians(10.0)):  # a narrow strip has no plane of its own
        found = normal
    return found, weighted_quantile(on.middle @ found, on.weight, 0.5)
