"""`render.device` draws the mesh's views and fuses them: block code in place of the CPU's kernels, the same mesh."""

from __future__ import annotations

from contextlib import nullcontext

import numpy as np
import pytest
import torch
import trimesh

from room2dgs.captures.read import read_scene
from room2dgs.config import load_config
from room2dgs.errors import InputError
from room2dgs.eval.surface import Surface
from room2dgs.kernels.builds import PLAIN
from room2dgs.kernels.emulation import cuda_kernels_on_cpu
from room2dgs.kernels.operators import BY_BLOCK_CODE
from room2dgs.mesh import device_volume
from room2dgs.pipeline.mesh import make_mesh
from room2dgs.pipeline.run_folder import RunFolder
from room2dgs.splat import Surfels


def settings(wall, out, device):
    more = [
        "mesh.max_error_m=null",
        "mesh.voxel_m=0.04",
        "mesh.min_triangles=1",
        f"render.device={device}",
        "mesh.min_weight=2",
    ]
    return load_config([f"scene.path={wall}", f"out={out}", *more])


def surfels_of_wall(wall) -> Surfels:
    centers = torch.from_numpy(np.array(trimesh.load(wall / "gt_mesh.ply", process=False).vertices, np.float32))
    count = len(centers)
    turn = torch.tensor([[1.0, 0, 0, 0]]).repeat(count, 1)
    color = torch.rand(count, 1, 3, generator=torch.Generator().manual_seed(0))
    return Surfels(centers, turn, torch.full((count, 2), 0.06), torch.full((count,), 0.9), color)


def test_blocks_make_the_cpus_mesh(wall, tmp_path, monkeypatch):
    surfels, drawn, fused = surfels_of_wall(wall), [], []
    draw, take_in = BY_BLOCK_CODE["rasterize"], device_volume._integrate_one
    monkeypatch.setitem(BY_BLOCK_CODE, "rasterize", lambda *view: (drawn.append(view[0] is PLAIN), draw(*view))[1])
    monkeypatch.setattr(device_volume, "_integrate_one", lambda *view: (fused.append(1), take_in(*view))[1])
    made = {}
    for device, kernels in {"cpu": nullcontext, "blocks": cuda_kernels_on_cpu}.items():
        config = settings(wall, tmp_path / device, "cpu")
        scene = read_scene(config.scene)
        with kernels():
            make_mesh(scene, surfels, config, RunFolder(tmp_path / device, lambda _: None))
        made[device] = trimesh.load(tmp_path / device / "mesh.ply", process=False)
        assert len(drawn) == len(fused) == (0 if device == "cpu" else len(scene.train))
    cpu, found = made["cpu"], made["blocks"]
    assert len(cpu.faces) > 500 and len(found.faces) == pytest.approx(len(cpu.faces), rel=0.01)
    assert Surface(cpu).closest(np.asarray(found.vertices))[0].max() < 1e-3


def test_no_gpu_is_one_sentence_and_the_earlier_mesh_stays(wall, tmp_path, without_gpu):
    config = settings(wall, tmp_path, "cuda")
    (tmp_path / "mesh.ply").write_text("earlier")
    with pytest.raises(InputError, match=r"render\.device=cuda lacks"):
        make_mesh(read_scene(config.scene), surfels_of_wall(wall), config, RunFolder(tmp_path, lambda _: None))
    assert (tmp_path / "mesh.ply").read_text() == "earlier"
