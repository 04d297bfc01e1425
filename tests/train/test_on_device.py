"""Training with everything on a device: the CPU's result, the same bits again, and nothing that is waited for.

No GPU is needed; where there is one, it is taken. Without one the loop is the GPU's and its kernels are plain C++
(`cuda_kernels_on_cpu`). And torch's device "meta", which has no numbers at all, refuses whatever a GPU would have to be
waited for, and tensors of two devices.
"""

from __future__ import annotations

import importlib
from contextlib import contextmanager, nullcontext
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from torch.utils._python_dispatch import TorchDispatchMode

from room2dgs import cuda_state
from room2dgs.captures.view_maps import ViewMaps
from room2dgs.errors import InputError
from room2dgs.kernels.builds import BLOCK_BUILDS, Build, set_order
from room2dgs.kernels.emulation import block_code_on, cuda_kernels_on_cpu
from room2dgs.kernels.operators import BY_BLOCK_CODE
from room2dgs.mesh.views import fused_view
from room2dgs.train import load_surfels, run, train
from room2dgs.train.corrections import PoseCorrections
from room2dgs.train.device import DeviceCache
from room2dgs.train.trainer import Hook

ALL_TERMS = [
    "loss.multiview_geometric.enabled=true", "loss.multiview_geometric.start=2",
    "loss.multiview_photometric.enabled=true", "loss.multiview_photometric.start=2",
    "loss.multiview.samples=100", "loss.multiview.patch=5", "loss.multiview.min_baseline_m=0.05",
    "loss.normal_reweighting.enabled=true",
    "seeds.opacity=0.1",  # with opaque discs the signs of tiny gradients tell two runs apart within ten iterations
]  # fmt: skip
GROWING = ["strategy=seeds", "strategy.start=4", "strategy.every=4", "strategy.stop=12", "train.iterations=14"]
EMULATED = bool(cuda_state.missing())
DEVICE = f"render.device={'cpu' if EMULATED else 'cuda'}"


def trained_on_device(capture, config, out, log):
    """By block code: on the GPU where there is one."""
    with cuda_kernels_on_cpu() if EMULATED else nullcontext():
        return trained(capture, config, out, log)


def priors(scene) -> dict[str, ViewMaps]:
    """The wall, a little off."""
    depth = np.full((24, 32), 1.5, np.float32) + np.linspace(0, 0.1, 32, dtype=np.float32)
    normal = np.broadcast_to(np.array([0, 0.1, -0.995], np.float32), (24, 32, 3)).copy()
    confidence = np.full((24, 32), 0.8, np.float32)
    return {frame.name: ViewMaps(depth, confidence, normal, confidence) for frame in scene.train}


def trained(capture, config, out, log, hooks=()):
    result = train(*capture, config, out, log, priors(capture[0]), hooks)
    return result, load_surfels(result.surfels_path)


FIXED = ["train.iterations=14"]
# after some more iterations, rounding alone (another instruction set) is as large as what is compared
SHARED = ["train.iterations=10", "seeds.decoder=shared", "train.refine_poses=true"]


GAUSSIANS = [*GROWING, "primitive=gaussian3d"]
MIP = [*FIXED, "primitive=mip_gaussian3d", "train.refine_poses=true"]
RUNS = {"fixed": FIXED, "shared": SHARED, "growing": GROWING, "3D, growing": GAUSSIANS, "3D mip": MIP}


@pytest.mark.parametrize("more", RUNS.values(), ids=RUNS)
def test_the_cpus_result_and_the_same_bits_again(capture, configure, log, tmp_path, more):
    settings = [*ALL_TERMS, *more, "train.test_every=7"]
    cpu, expected = trained(capture, configure(*settings), tmp_path / "cpu", log)
    found, surfels = trained_on_device(capture, configure(*settings, DEVICE), tmp_path / "device", log)
    assert found.losses.keys() == cpu.losses.keys()
    # where seeds are added, a gradient beside the threshold may fall to either side of it
    growing = "strategy=seeds" in more
    relative = 2e-2 if growing else 2e-3
    slack = 1 if EMULATED else 2  # a GPU's exp and sigmoid are others than the CPU's
    assert found.seeds == pytest.approx(cpu.seeds, rel=relative)
    for name, value in cpu.losses.items():
        assert found.losses[name] == pytest.approx(value, rel=relative, abs=slack * 5e-5), name
    assert found.test_psnr_db == pytest.approx(cpu.test_psnr_db, rel=relative)
    # Adam makes a full step of whatever sign a tiny gradient has, so the mean is what tells
    for name, a, b in zip(surfels._fields, surfels, expected, strict=True):
        # and hardly any gradient turns a round disc in its plane
        share = slack * (1e-2 if name == "rotations" else 1e-3)
        assert growing or (a - b).abs().mean() < share * b.abs().max(), name
    set_order(5)
    try:
        trained_on_device(capture, configure(*settings, DEVICE), tmp_path / "again", log)
    finally:
        set_order(0)
    first, again = ((tmp_path / name / "surfels.safetensors").read_bytes() for name in ("device", "again"))
    assert first == again


def test_a_killed_run_resumes_to_the_same_bits_but_not_on_another_device(capture, configure, log, tmp_path, dies_after):
    settings = [
        *ALL_TERMS,
        *GROWING,
        DEVICE,
        "train.refine_poses=true",
        "train.checkpoint_every=3",
    ]
    other = "render.device=cuda" if EMULATED else "render.device=cpu"
    whole, _ = trained_on_device(capture, configure(*settings), tmp_path / "whole", log)
    with dies_after(9):
        trained_on_device(capture, configure(*settings), tmp_path / "cut", log)
    with pytest.raises(InputError, match=r"render\.device"):
        trained(capture, configure(*settings, other, "resume=true"), tmp_path / "cut", log)
    resumed, _ = trained_on_device(capture, configure(*settings, "resume=true"), tmp_path / "cut", log)
    assert resumed.surfels_path.read_bytes() == whole.surfels_path.read_bytes()


class Kernels:
    """`_cuda`, but for the work: it takes what it is given."""

    visible = entries = moved = 0

    def __init__(self, scene) -> None:
        self.calls: list[str] = []
        self._camera = scene.train[0].camera
        self.BlockFrame = self.GaussianBlockFrame = self.BlockLosses = lambda: self

    def camera(self):
        return self._camera.cam_from_world.ravel().tolist(), self._camera.K.ravel().tolist(), [0.0, 0.0, 0.0]

    def __getattr__(self, name):
        def called(*arguments, **_):
            self.calls.append(name)
            tensors = [x for x in arguments if isinstance(x, torch.Tensor)]
            assert all(x.device.type == "meta" and x.is_contiguous() for x in tensors), name
            return 1

        return called


class NothingWaits(TorchDispatchMode):
    """Counts what is moved to the device, and finds operators that mix devices but do not mind."""

    def __init__(self) -> None:
        super().__init__()
        self.uploads = 0

    def __torch_dispatch__(self, function, types, args=(), kwargs=None):
        if function.namespace == "room2dgs":  # what its kernels are given is watched, too
            with self:
                return BY_BLOCK_CODE[function._opname](BLOCK_BUILDS["meta"], *args)
        flat = [x for a in args for x in (a if isinstance(a, (list, tuple)) else (a,))]
        tensors = [x for x in flat if isinstance(x, torch.Tensor)]
        devices = {x.device.type for x in tensors if x.dim() or x.device.type == "meta"}
        result = function(*args, **(kwargs or {}))
        if "_to_copy" in str(function):
            self.uploads += result.device.type == "meta" and tensors[0].device.type == "cpu"
        else:
            assert devices != {"meta", "cpu"}, f"{function} has tensors of both"
        return result


@pytest.fixture
def without_numbers(capture, monkeypatch):
    """The device "meta" in a GPU's place."""
    kernels = Kernels(capture[0])

    @contextmanager
    def on_device(name):
        yield torch.device("meta")

    monkeypatch.setattr(run, "on_device", on_device)
    monkeypatch.setattr(PoseCorrections, "on_end", lambda self, trainer: None)  # after the last iteration it may read
    name = "_get_fused_kernels_supported_devices"  # torch's Adam asks for them
    for module in ("torch.optim.adam", "torch.optim.optimizer", "torch.utils._foreach_utils"):
        monkeypatch.setattr(importlib.import_module(module), name, lambda: ["cpu", "meta"], raising=False)
    with block_code_on("meta", Build(kernels, lambda like: 0)):
        yield kernels


class Ends(Exception):
    """A run without numbers has no result."""


@pytest.mark.parametrize(
    "more",
    [
        ["strategy=seeds"],
        ["seeds.decoder=shared", "train.refine_poses=true", "train.random_background=true"],
        ["strategy=plain", "seeds.per_seed=1"],
        ["strategy=seeds", "primitive=gaussian3d"],
        ["seeds.per_seed=1", "primitive=mip_gaussian3d", "train.refine_poses=true"],
    ],
)
def test_an_iteration_waits_for_nothing_but_the_frames_own_counts(
    capture, configure, log, tmp_path, without_numbers, more
):
    """All terms, priors, screen gradients; 16 iterations, of which the first ones move the views to the device."""
    seen = SimpleNamespace(uploads=[])

    class Watch(Hook):
        def after_step(self, trainer, iteration):
            seen.uploads.append((mode.uploads, iteration.pair is not None))
            assert iteration.screen_gradients == any("strategy" in setting for setting in more)
            if iteration.done == 16:
                raise Ends

    settings = [*ALL_TERMS, *more, "train.iterations=100", "train.log_every=50", "train.checkpoint_every=50"]
    settings += ["strategy.start=30"] if "strategy=seeds" in more or "strategy=plain" in more else []
    with pytest.raises(Ends), NothingWaits() as mode:
        trained(capture, configure(*settings), tmp_path, log, [Watch()])
    assert {"forward", "backward", "rgb_loss", "normal_consistency", "depth_prior", "normal_prior", "multiview"} <= set(
        without_numbers.calls
    )
    # when all views are there, an iteration moves the drawn pixels, and nothing else
    late = [after[0] - before[0] for before, after in zip(seen.uploads[9:], seen.uploads[10:], strict=False)]
    assert all(pair for _, pair in seen.uploads[9:]) and set(late) == {1}


def test_the_watch_finds_what_waits(capture, configure, log, tmp_path, without_numbers):
    class Asks(Hook):
        def after_step(self, trainer, iteration):
            float(iteration.step.losses["loss"])

    with pytest.raises(RuntimeError, match="cannot be called on meta"), NothingWaits():
        trained(capture, configure(), tmp_path, log, [Asks()])


def test_a_view_of_the_mesh_stays_on_the_device(capture, configure):
    camera = capture[0].train[0].camera
    shape = (camera.height, camera.width)
    maps = {name: torch.ones(*shape, device="meta") for name in ("alpha", "depth", "median_depth")}
    colors = {name: torch.ones(*shape, 3, device="meta") for name in ("color", "normal")}
    with NothingWaits():
        view = fused_view(SimpleNamespace(**maps, **colors), camera, configure().mesh)
    assert view.depth.device.type == view.color.device.type == "meta"
    assert view.depth.dtype == view.color.dtype == torch.float32 and view.color.shape == (*shape, 3)


def test_views_stay_on_the_device_within_a_budget():
    made = []

    def make(name):
        made.append(name)
        return ViewMaps(torch.zeros(250), None, None, None)

    cache = DeviceCache(torch.device("cpu"), 2.5e-3)  # two of 1000 bytes
    for name in "abacab":
        cache.get_or(name, lambda name=name: make(name))
    assert made == ["a", "b", "c", "b"] and cache.in_memory == 2000


def test_a_gpu_that_is_not_there_is_one_sentence(capture, configure, log, tmp_path, without_gpu):
    with pytest.raises(InputError, match=r"render\.device=cuda lacks .*; give render\.device=cpu"):
        trained(capture, configure("render.device=cuda"), tmp_path, log)
