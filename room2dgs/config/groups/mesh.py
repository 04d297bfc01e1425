"""conf/mesh: depth to mesh."""

from __future__ import annotations

from typing import Literal

from pydantic import Field
from pydantic.dataclasses import dataclass

from room2dgs.config.fields import GROUP, Float, Int
from room2dgs.config.names import MesherName, described
from room2dgs.registries.meshers import MESHERS


@dataclass(config=GROUP)
class MeshConfig:
    """Depth to mesh."""

    source: MesherName = Field(description=described("What the mesh is made of.", MESHERS))
    voxel_m: Float | None = Field(
        ge=1e-3, le=1, description="side of a voxel (null: two pixels of the photos at 2.5 m, 1 to 2 cm)"
    )
    space: Literal["bounded", "contracted"] = Field(
        description="bounded | contracted: outside the room voxels grow with the distance"
    )
    truncation_voxels: Float = Field(ge=1, le=8, description="truncation distance of the TSDF, in voxels")
    depth: Literal["smooth", "median", "expected"] = Field(
        description="smooth (expected where that is within 1 % of the median, else median) | median | expected"
    )
    max_depth_m: Float = Field(ge=0.1, description="farther pixels are not fused")
    min_alpha: Float = Field(ge=0, le=1, description="pixels less covered are not fused")
    max_expected_m: Float | None = Field(
        gt=0, description="pixels whose prior depth is expected to be farther off are not fused (null: all are)"
    )
    max_angle_deg: Float = Field(
        ge=1, le=90, description="between surface normal and view ray; steeper pixels are not fused"
    )
    min_weight: Float = Field(ge=0, description="voxels that fewer views have seen are not meshed")
    min_triangles: Int = Field(ge=0, description="smaller connected pieces are dropped")
    keep_clusters: Int = Field(ge=1, description="at most this many connected pieces")
    smoothing_steps: Int = Field(
        ge=0, le=100, description="what takes the roughness of the voxels off the surface; rims stay (0: as it is)"
    )
    fill: Literal["none", "holes", "watertight"] = Field(
        description="none | holes: close small ones | watertight: a closed surface, also where nothing was seen"
    )
    fill_hole_m: Float = Field(
        ge=0, le=100, description="fill=holes: the largest that is closed, by the diagonal of its box"
    )
    max_error_m: Float | None = Field(
        gt=0, description="as few faces as keep 99.9 % this close to the whole surface (null: all faces)"
    )

    @property
    def of_surfels(self) -> bool:
        """Whether a run has surfels, which are trained; the other sources need no training."""
        return bool(MESHERS.get(self.source).facts["trains"])

    @property
    def with_priors(self) -> bool:
        """Whether a run reads priors; some sources know of none, whatever `prior` says."""
        return bool(MESHERS.get(self.source).facts["reads_priors"])
