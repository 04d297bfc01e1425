"""The CUDA kernels as plain C++: against float64, the CPU's kernels, and another order of theirs."""

from __future__ import annotations

import os
import subprocess
import sys
from contextlib import nullcontext
from types import SimpleNamespace

import pytest
import torch

from room2dgs import splat
from room2dgs.kernels.builds import CUDA, set_order
from room2dgs.kernels.emulation import cuda_kernels_on_cpu
from room2dgs.primitives.gaussian3d import MipGaussians
from room2dgs.splat import Gaussians, Surfels
from room2dgs.splat.api import check_kernels
from room2dgs.splat.constants import OPACITY_FLOOR
from room2dgs.splat.gaussians import operators as gaussian_operators
from room2dgs.splat.operators import rasterize, rasterize_backward
from room2dgs.tools.numerics.compare import compare, differentiate, image_weights, relative_error
from room2dgs.tools.numerics.gaussians import thickened
from room2dgs.tools.numerics.kinds import kind_of
from room2dgs.tools.numerics.measure import ALL_SCENES
from room2dgs.tools.numerics.scenes import ILL_CONDITIONED, NEAR_M, HardScene, intrinsics, pose, random_surfels

APART = 3e-5  # what sums in another order change, and fused arithmetic on one side


def tall() -> HardScene:
    """Discs from below a pixel to over all tiles: more rows of tiles than are kept, lists of several batches."""
    parts = [random_surfels(500, 1, (0.002, 0.05)), random_surfels(60, 2, (0.3, 3.0), opacity=(0.05, 0.3))]
    surfels = Surfels(*(torch.cat(x) for x in zip(*parts, strict=True)))
    return HardScene(surfels, intrinsics(170, 180, 101.3, 77.2), pose(), 203, 149)


def as_gaussians(surfels: Surfels) -> Gaussians:
    """With a third scale."""
    return Gaussians(*surfels._replace(scales=torch.cat([surfels.scales, 0.4 * surfels.scales[:, :1]], dim=1)))


KINDS = {"surfels": lambda surfels: surfels, "3D": as_gaussians}
RENDER = {"surfels": splat.render, "3D": splat.render_gaussians}
ALL = {
    **ALL_SCENES,
    "tall": tall,
    "tall, 3D": lambda: thickened(tall()),
    "tall, 3D mip": lambda: thickened(tall(), kind=MipGaussians),
}


@pytest.fixture(autouse=True)
def one_thread():
    """Of torch: its tensors are small here."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)
    set_order(0)


def both(scene: HardScene) -> list[torch.Tensor]:
    """Images and gradients."""
    weights = image_weights(scene.width, scene.height, unit=scene.near_m / NEAR_M)
    images, gradients = differentiate(kind_of(scene).render, scene, weights, torch.float32)
    return [*images, *gradients.values()]


@pytest.mark.parametrize("name", ALL)
def test_they_equal_the_cpu_and_themselves_in_any_order(name):
    scene = ALL[name]()
    expected = both(scene)
    with cuda_kernels_on_cpu():
        actual = both(scene)
        again = []
        for seed in (1, 2):
            set_order(seed)
            again.append(both(scene))
    conditioned = 10 if name in ILL_CONDITIONED else 1
    for a, b in zip(actual, expected, strict=True):
        assert relative_error(a, b) < conditioned * APART
    for other in again:
        assert all(torch.equal(a, b) for a, b in zip(other, actual, strict=True))


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in ALL_SCENES if "coincident layers" not in name])  # they take long
def test_they_equal_the_float64_reference(name):
    set_order(3)
    with cuda_kernels_on_cpu():
        found = compare(ALL_SCENES[name](), name in ILL_CONDITIONED)
    assert found.passed, found


def test_bits_of_the_cpu_without_fused_arithmetic_and_the_way_to_a_build_of_cuda():
    """One source of the maths: forward, there is nothing left that could differ. Plain C++ has no fused multiply-add.

    With plain C++ in the place of `_cuda`, that is found, registered and chosen for tensors of a GPU.
    """
    program = (
        "import sys, torch, room2dgs\n"
        "from room2dgs import _C\n"
        "sys.modules['room2dgs._cuda'] = room2dgs._cuda = _C.device\n"
        "from tests_of_blocks import ALL, SimpleNamespace, cuda_kernels_on_cpu, kind_of, splat\n"
        "from room2dgs.kernels import builds\n"
        "like = SimpleNamespace(device=torch.device('cuda'), dtype=torch.float32)\n"
        "splat.api.check_kernels(like)\n"
        "assert builds.CUDA.extension is builds.BLOCK_BUILDS['cuda'].extension is _C.device\n"
        "assert 'CUDA' in torch._C._dispatch_dump('room2dgs::rasterize')\n"
        "assert _C.isa() == 'baseline'\n"
        "for name, make in ALL.items():\n"
        "    s = make()\n"
        "    args = (s.surfels, s.K, s.cam_from_world, s.width, s.height)\n"
        "    options = {'near_m': s.near_m, 'opacity_floor': s.opacity_floor}\n"
        "    render = kind_of(s).render\n"
        "    expected = render(*args, **options)\n"
        "    with cuda_kernels_on_cpu():\n"
        "        pairs = zip(expected, render(*args, **options))\n"
        "    assert all(torch.equal(a, b) for a, b in pairs), name\n"
    )
    load = (
        "import importlib.util, sys\n"
        f"spec = importlib.util.spec_from_file_location('tests_of_blocks', {__file__!r})\n"
        "module = sys.modules['tests_of_blocks'] = importlib.util.module_from_spec(spec)\n"
        "spec.loader.exec_module(module)\n"
    )
    env = {**os.environ, "ROOM2DGS_ISA": "baseline", "OMP_NUM_THREADS": "1"}
    head, rest = program.split("from tests_of_blocks", 1)
    subprocess.run([sys.executable, "-c", f"{head}{load}from tests_of_blocks{rest}"], check=True, env=env)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("flows", [("color",), ("median_depth", "alpha"), ("distortion",), ("normal", "depth")])
def test_gradients_of_some_images_alone(flows, kind):
    """Kernels without normals or distortion, and images that nothing flows back from."""
    splats = KINDS[kind](random_surfels(80, 3))
    splats, render = type(splats)(*(x.requires_grad_() for x in splats)), RENDER[kind]
    wanted = {"with_normal": "normal" in flows, "with_distortion": "distortion" in flows}
    found = []
    for kernels in (nullcontext, cuda_kernels_on_cpu):
        with kernels():
            out = render(splats, intrinsics(), pose(), 37, 29, **wanted)
            total = sum(getattr(out, name).square().sum() for name in flows)
            found.append([*out, *torch.autograd.grad(total, splats)])
    for a, b in zip(*found, strict=True):
        assert relative_error(b.detach(), a.detach()) < APART


@pytest.mark.parametrize("kind", KINDS)
def test_a_lost_state_is_rendered_again(kind):
    """A copy of the state is no frame: the backward pass draws again, to the same bits."""
    forward, backward, more = {
        "surfels": (rasterize, rasterize_backward, ()),
        "3D": (gaussian_operators.rasterize, gaussian_operators.rasterize_backward, (0.1, True)),
    }[kind]
    inputs = (*KINDS[kind](random_surfels(40, 5)), pose(), intrinsics(), torch.zeros(3))
    options = (37, 29, NEAR_M, OPACITY_FLOOR, True, True, *more)
    with cuda_kernels_on_cpu():
        color, alpha, depth, *_, state = forward(*inputs, None, *options)
        flows = (torch.ones_like(color), *[None] * 5)
        first = backward(*inputs, alpha, depth, state, *flows, *options, True)
        again = backward(*inputs, alpha, depth, state.clone(), *flows, *options, True)
    assert all(torch.equal(a, b) for a, b in zip(first, again, strict=True))


@pytest.mark.parametrize("kind", KINDS)
def test_what_the_cpu_refuses_is_refused_in_the_same_words(kind):
    splats, K, place, render = KINDS[kind](random_surfels(5)), intrinsics(), pose(), RENDER[kind]
    skewed, nan = K.clone(), place.clone()
    skewed[0, 1], nan[1, 1] = 0.5, float("nan")
    moved = torch.zeros(5, 2)
    moved[3, 1] = 1e-3
    bad = [
        {"K": skewed}, {"K": -K}, {"cam_from_world": nan}, {"cam_from_world": 2 * place}, {"near_m": -1.0},
        {"background": torch.tensor([0.0, float("inf"), 0])}, {"center_px": moved},
    ]  # fmt: skip
    for changed in bad:
        arguments = {"K": K, "cam_from_world": place, "width": 8, "height": 8, **changed}
        said = []
        for kernels in (nullcontext, cuda_kernels_on_cpu):
            with kernels(), pytest.raises(ValueError) as error:
                render(splats, **arguments)
            said.append(str(error.value))
        assert said[0] == said[1], changed
    with cuda_kernels_on_cpu():
        render(splats, K, place, 8, 8)


def test_without_cuda_one_sentence_says_how_to_get_it():
    if CUDA is not None:
        pytest.skip("this build has CUDA")
    like = SimpleNamespace(device=torch.device("cuda"), dtype=torch.float32)
    with pytest.raises(ValueError, match=r"built without CUDA.*ROOM2DGS_CUDA=on.*docs/how-to/gpu.md"):
        check_kernels(like)
