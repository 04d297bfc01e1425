"""`render.device` draws the mesh's views and fuses them: block code in place of the CPU's kernels, the same mesh."""

from __future__ import annotations

import numpy as np
import pytest
import torch
import trimesh

from room2dgs.captures.read import read_scene
from room2dgs.commands.mesh import mesh_scene
from room2dgs.config import load_config
from room2dgs.errors import InputError
from room2dgs.eval.surface import Surface
from room2dgs.mesh import device_volume
from room2dgs.splat import Surfels
from room2dgs.splat.backends import blocks


def settings(wall, out, device):
    more = [
        "mesh.max_error_m=null",
        "mesh.voxel_m=0.04",
        "mesh.min_triangles=1",
        f"render.device={device}",
        "mesh.min_weight=2",
    ]
    return load_config([f"scene.path={wall}", f"out={out}", *more])


def discs(wall) -> Surfels:
    centers = torch.from_numpy(np.array(trimesh.load(wall / "gt_mesh.ply", process=False).vertices, np.float32))
    count = len(centers)
    turn = torch.tensor([[1.0, 0, 0, 0]]).repeat(count, 1)
    color = torch.rand(count, 1, 3, generator=torch.Generator().manual_seed(0))
    return Surfels(centers, turn, torch.full((count, 2), 0.06), torch.full((count,), 0.9), color)


def test_blocks_make_the_cpus_mesh(wall, tmp_path, monkeypatch):
    surfels, drawn, fused = discs(wall), [], []
    draw, take_in = blocks.BACKEND.render, device_volume._take_in
    monkeypatch.setattr(
        blocks, "BACKEND", blocks.BACKEND._replace(render=lambda *view: (drawn.append(1), draw(*view))[1])
    )
    monkeypatch.setattr(device_volume, "_take_in", lambda *view: (fused.append(1), take_in(*view))[1])
    made = {}
    for device in ("cpu", "blocks"):
        config = settings(wall, tmp_path / device, device)
        scene = read_scene(config.scene)
        mesh_scene(scene, surfels, config, tmp_path / device, lambda _: None, {})
        made[device] = trimesh.load(tmp_path / device / "mesh.ply", process=False)
        assert len(drawn) == len(fused) == (0 if device == "cpu" else len(scene.train))
    cpu, found = made["cpu"], made["blocks"]
    assert len(cpu.faces) > 500 and len(found.faces) == pytest.approx(len(cpu.faces), rel=0.01)
    assert Surface(cpu).closest(np.asarray(found.vertices))[0].max() < 1e-3


def test_no_gpu_is_one_sentence_and_the_earlier_mesh_stays(wall, tmp_path, without_gpu):
    config = settings(wall, tmp_path, "cuda")
    (tmp_path / "mesh.ply").write_text("earlier")
    with pytest.raises(InputError, match=r"render\.device=cuda lacks"):
        mesh_scene(read_scene(config.scene), discs(wall), config, tmp_path, lambda _: None, {})
    assert (tmp_path / "mesh.ply").read_text() == "earlier"
