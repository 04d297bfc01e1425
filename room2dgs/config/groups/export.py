"""`export`: results in the files of other programs."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic.dataclasses import dataclass

from room2dgs.config.fields import GROUP, Float, Int, Name, expert, public
from room2dgs.registries.exporters import EXPORTERS


def quick_formats() -> tuple[str, ...]:
    """Formats that a run can write at its end in about a second each."""
    return tuple(entry.name for entry in EXPORTERS.entries() if entry.facts.get("after_run"))


@dataclass(config=GROUP)
class ExportConfig:
    """What other programs are given."""

    after_run: list[Annotated[str, Name(quick_formats)]] = public(
        ["splats"], "Formats that every run writes at its end ([]: none)."
    )
    up: Literal["auto", "keep", "x", "y", "z", "-x", "-y", "-z"] = public(
        "auto",
        "Axis of the world that points up. auto: it is found. keep: exports are not turned to the up axis of their "
        "format.",
    )
    faces: Int | None = public(None, "Number of faces to which exported meshes are simplified (null: any).", ge=100)
    max_error_m: Float | None = expert(
        None, "Largest distance in metres of 99.9 % of a simplified mesh from the full one (null: any).", gt=0
    )
    textured: bool = expert(
        True, "Whether a run writes mesh.glb beside mesh.ply: few faces with a picture of the photos on them."
    )
    texture_px: Int = expert(2048, "Largest side of a texture, in pixels; small photos fill less.", ge=256, le=8192)
    texture_faces: Int = expert(
        20_000, "Number of faces of a textured mesh where export.faces is not given.", ge=100, le=200_000
    )
