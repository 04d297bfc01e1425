"""`mesh`: depth to mesh."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic.dataclasses import dataclass

from room2dgs.config.fields import GROUP, Float, Int, Name, expert, public
from room2dgs.config.names import described
from room2dgs.registries.meshers import MESHERS


@dataclass(config=GROUP)
class MeshConfig:
    """Depth to mesh."""

    source: Annotated[str, Name(MESHERS.names)] = public("surfels", described("What the mesh is made of.", MESHERS))
    voxel_m: Float | None = public(
        None, "Side of a voxel in metres (null: two pixels of the photos at 2.5 m, 1 to 2 cm).", ge=1e-3, le=1
    )
    space: Literal["bounded", "contracted"] = expert(
        "bounded", "Space in which depth is fused. contracted: outside the room voxels grow with the distance."
    )
    truncation_voxels: Float = expert(3.0, "Truncation distance of the TSDF, in voxels.", ge=1, le=8)
    depth: Literal["smooth", "median", "expected"] = expert(
        "smooth",
        "Rendered depth that is fused. smooth: the expected depth where it is within 1 % of the median depth, else the "
        "median depth.",
    )
    max_depth_m: Float = public(8.0, "Largest depth in metres that is fused.", ge=0.1)
    min_alpha: Float = expert(0.5, "Smallest accumulated opacity of a pixel that is fused.", ge=0, le=1)
    max_expected_m: Float | None = expert(
        0.3,
        "Largest expected error in metres of prior depth that is fused, and of the finished surface (null: any).",
        gt=0,
    )
    max_angle_deg: Float = expert(
        80.0, "Largest angle between the surface normal and the view ray of a pixel that is fused.", ge=1, le=90
    )
    min_weight: Float = expert(1.0, "Number of views that must have seen a voxel for it to be meshed.", ge=0)
    min_triangles: Int = expert(50, "Number of triangles below which a connected piece is dropped.", ge=0)
    keep_clusters: Int = expert(50, "Largest number of connected pieces that are kept.", ge=1)
    smoothing_steps: Int = expert(
        5, "Steps of smoothing that remove the roughness of the voxels; borders stay in place.", ge=0, le=100
    )
    flatten: bool = expert(True, "Put walls, floors and table tops on their planes where they lie within 8 mm.")
    glass: Literal["leave_out", "keep"] = expert(
        "leave_out",
        "What mirrors show. leave_out: the glass takes its place in mesh and plan, mirrors.json says where. keep: it "
        "is meshed as a room behind the wall.",
    )
    inferred: bool = expert(
        True,
        "Close gaps of up to 20 cm between measured parts of the surface; mesh.ply marks their vertices (source = 1).",
    )
    fill: Literal["none", "holes", "watertight"] = public(
        "holes",
        "Which openings of the mesh are closed. holes: those up to mesh.fill_hole_m. watertight: all, also "
        "where nothing "
        "was seen.",
    )
    fill_hole_m: Float = expert(
        0.1, "Largest hole that mesh.fill=holes closes: the diagonal of its bounding box in metres.", ge=0, le=100
    )
    max_error_m: Float | None = public(
        0.005,
        "Largest distance in metres of 99.9 % of the simplified mesh from the full one (null: all faces stay).",
        gt=0,
    )

    @property
    def of_surfels(self) -> bool:
        """Whether a run has surfels, which are trained; the other sources need no training."""
        return bool(MESHERS.get(self.source).facts["trains"])

    @property
    def with_priors(self) -> bool:
        """Whether a run reads priors; some sources know of none, whatever `prior` says."""
        return bool(MESHERS.get(self.source).facts["reads_priors"])
