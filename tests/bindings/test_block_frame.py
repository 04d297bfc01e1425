"""The rasterizer of block code (`_C.device`) on the hard corpus, without torch; also for `make sanitize`.

What it draws is tested in tests/splat/test_blocks.py; here no index may be wrong, in any order of blocks and threads.
"""

from __future__ import annotations

import os

import numpy as np
import pytest

from room2dgs import _C

SURFELS = ("centers", "rotations", "scales", "opacities", "sh")
FLOOR = 1 / 255
FRAMES = {2: ("BlockFrame", "RasterFrame"), 3: ("GaussianBlockFrame", "GaussianFrame")}  # by the number of scales


def _corpus() -> dict[str, dict[str, np.ndarray]]:
    """Scenes by name; from the file that ROOM2DGS_CORPUS names where torch may not be imported."""
    if path := os.environ.get("ROOM2DGS_CORPUS"):
        file = np.load(path)
        names = sorted({key.partition("/")[0] for key in file})
        return {
            name: {key.partition("/")[2]: file[key] for key in file if key.startswith(name + "/")} for name in names
        }
    from room2dgs.tools.numerics.measure import ALL_SCENES

    return {name: plain(make(), "mip" in name) for name, make in ALL_SCENES.items()}


def plain(scene, mip: bool) -> dict[str, np.ndarray]:
    """A hard scene as arrays."""
    found = {name: np.ascontiguousarray(getattr(scene.surfels, name).numpy()) for name in SURFELS}
    return found | {
        "pose": np.ascontiguousarray(scene.cam_from_world.double().numpy()),
        "K": scene.K.double().numpy(),
        "size": np.array([scene.width, scene.height]),
        "near": np.array(scene.near_m),
        "floor": np.array(scene.opacity_floor),
        "filter": np.array([0.1, 1.0] if mip else [0.3, 0.0]),  # variance, and whether the opacity makes good for it
    }


CORPUS = _corpus()


def drawn(frame, scene, background, queue: tuple = (), **wanted) -> list[np.ndarray]:
    """Images and gradients; what is not written stays NaN."""
    (w, h), n = scene["size"].tolist(), len(scene["centers"])
    shapes = [(h, w, 3), (h, w), (h, w), (h, w), (h, w, 3), (h, w)]
    maps = [np.full(shape, np.nan, np.float32) for shape in shapes]
    surfels = [scene[name] for name in SURFELS]
    extra = {"queue": queue[0]} if queue else {}
    if wanted.get("color_alone"):
        maps[4:] = None, None
    view = (scene["pose"], scene["K"], w, h, float(scene["near"]), float(scene["floor"]))
    more = (float(scene["filter"][0]), bool(scene["filter"][1])) if scene["scales"].shape[1] == 3 else ()
    number = frame.forward(*surfels, *view, background, *maps, *more, **extra)
    rng = np.random.default_rng(0)
    flows = [rng.standard_normal(shape, np.float32) for shape in shapes]
    if wanted.get("color_alone"):
        flows[1:] = [None] * 5
    to = [np.full_like(x, np.nan) for x in surfels] + [np.full((n, 2), np.nan, np.float32)]
    to += [np.full((4, 4), np.nan), np.full((3, 3), np.nan), np.full(3, np.nan)]
    frame.backward(number, *surfels, maps[1], maps[2], *flows, *to, **extra)
    return [x for x in maps if x is not None] + to


@pytest.mark.parametrize("name", CORPUS)
def test_the_corpus(name):
    background = np.array([0.1, 0.4, 0.7], np.float32)
    of_blocks, of_the_cpu = FRAMES[CORPUS[name]["scales"].shape[1]]
    frame = getattr(_C.device, of_blocks)()
    first = drawn(frame, CORPUS[name], background, (0,))
    assert all(np.isfinite(x).all() for x in first)
    for threads, seed in ((1, 7), (3, 8)):
        _C.set_threads(threads)
        again = drawn(frame, CORPUS[name], background, (seed,))
        assert all(np.array_equal(a, b) for a, b in zip(first, again, strict=True))
    alone = drawn(frame, CORPUS[name], background, (9,), color_alone=True)
    assert np.array_equal(alone[0], first[0])
    assert frame.bytes > 0
    cpu = getattr(_C, of_the_cpu)()
    drawn(cpu, CORPUS[name], background)
    assert (frame.visible, frame.entries) == (cpu.visible, cpu.entries)  # the same tile lists


@pytest.mark.parametrize("scales", FRAMES)
def test_splats_of_any_bits(scales):
    """Numbers as they may come, NaN and infinite among them: nothing is written where it should not be."""
    rng = np.random.default_rng(3)
    background = np.zeros(3, np.float32)
    for k in range(20):
        n = int(rng.integers(1, 200))
        scene = {
            name: rng.integers(0, 2**32, (n, *shape), np.uint64).astype(np.uint32).view(np.float32)
            for name, shape in zip(SURFELS, ((3,), (4,), (scales,), (), (4, 3)), strict=True)
        }
        wild = rng.random(n) < 0.7
        scene["centers"][wild] = rng.normal(0, 2, (wild.sum(), 3))
        scene["opacities"][wild] = rng.random(wild.sum())
        scene |= {"pose": np.eye(4), "K": np.diag([90.0, 80, 1]), "near": np.array(0.05), "floor": np.array(FLOOR)}
        scene |= {"size": rng.integers(1, 300, 2), "filter": np.array([0.1, k % 2])}
        drawn(getattr(_C.device, FRAMES[scales][0])(), scene, background, (k,))


@pytest.mark.parametrize(("entry", "value"), [((0, 0), 0.0), ((1, 1), -5.0), ((0, 2), np.nan)])
def test_a_camera_that_cannot_be_draws_nothing(entry, value):
    scene = {name: x.copy() for name, x in CORPUS["ordinary"].items()}
    scene["K"][entry] = value
    (w, h), frame = scene["size"].tolist(), _C.device.BlockFrame()
    maps = [np.zeros((h, w, 3), np.float32), *(np.zeros((h, w), np.float32) for _ in range(3)), None, None]
    surfels = [scene[name] for name in SURFELS]
    number = frame.forward(*surfels, scene["pose"], scene["K"], w, h, 0.05, FLOOR, np.zeros(3, np.float32), *maps)
    assert number == 0 and frame.camera()[1][entry[0] * 3 + entry[1]] == pytest.approx(value, nan_ok=True)
    to = [np.zeros_like(x) for x in surfels] + [np.zeros((len(surfels[0]), 2), np.float32), np.eye(4), np.eye(3)]
    with pytest.raises(ValueError, match="no view"):
        frame.backward(0, *surfels, maps[1], maps[2], *[None] * 6, *to, None)
