"""What a new mesh or new surfels leave behind of before is named, with the commands that make it anew."""

from __future__ import annotations

import pytest

from room2dgs.runs.outdated import outdated


@pytest.fixture
def out(tmp_path):
    folder = tmp_path / "my run"
    for name in ("eval", "plan", "renders", "export"):
        (folder / name).mkdir(parents=True)
    for name in ("mesh.ply", "mesh.glb", "report.html", "export/splats.ply", "export/mesh.glb", "export/mesh.obj"):
        (folder / name).write_text("")
    return folder


def test_of_the_mesh_before(out):
    named, again = outdated(out, "mesh")
    assert named == "of the mesh before are still: eval/, export/mesh.glb, export/mesh.obj, plan/, report.html"
    commands = again.removeprefix("anew: ").split("; ")
    assert commands == [
        f"room2dgs {verb} '{out}'{more}"
        for verb, more in (("eval", ""), ("export", " to=glb,obj"), ("plan", ""), ("report", ""))
    ]


def test_of_the_surfels_before(out):
    named, again = outdated(out, "surfels")
    assert named == (
        "of the surfels before are still: mesh.ply, mesh.glb, eval/, renders/, export/splats.ply, plan/, report.html"
    )
    assert f"export '{out}' to=splats" in again


def test_a_run_without_results_has_nothing_of_before(tmp_path):
    assert outdated(tmp_path, "mesh") == outdated(tmp_path, "surfels") == []
