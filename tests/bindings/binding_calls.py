"""Every function of `_C`: its arguments by name, and arrays that fit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from room2dgs import _C


@dataclass(frozen=True)
class Array:
    """An array argument; `shape`: digits and names of sizes (h, w, n surfels, k coefficients, t tiles, c columns), and
    for joint depth k views, y x x samples of their maps, r x r knots, s draws, d and p rows of tables; f pixels of all
    k views, m = n + 1 firsts; u, v every second row and column."""

    name: str
    shape: str
    dtype: type = np.float32
    written: bool = False
    optional: bool = False

    def lengths(self, sizes: dict[str, int]) -> tuple[int, ...]:
        sizes = {**sizes, "t": -(-sizes["h"] // 16) * -(-sizes["w"] // 16), "c": 11}
        sizes |= {"y": sizes["h"] + 1, "x": sizes["w"] + 1, "r": sizes["k"] + 1, "s": sizes["h"] * sizes["w"]}
        sizes |= {"m": sizes["n"] + 1, "d": 19, "p": 18, "f": sizes["k"] * sizes["h"] * sizes["w"]}
        sizes |= {"u": -(-sizes["h"] // 2), "v": -(-sizes["w"] // 2)}
        return tuple(int(axis) if axis.isdigit() else sizes[axis] for axis in self.shape)


@dataclass(frozen=True)
class Call:
    """A function of `_C`, of `_C.bench`, which takes a frame first, or a method of `RasterFrame`."""

    name: str
    arguments: tuple[Array | str, ...]
    method: bool = False
    bench: bool = False

    def after_forward(self) -> bool:
        """True where a frame must hold a view."""
        return self.bench or self.name == "backward"

    def of(self, frame: _C.RasterFrame) -> Callable:
        """The function itself."""
        if self.bench:
            return partial(getattr(_C.bench, self.name), frame)
        return getattr(frame if self.method else _C, self.name)

    def arrays(self) -> list[Array]:
        return [argument for argument in self.arguments if isinstance(argument, Array)]


def _written(*arrays: Array) -> tuple[Array, ...]:
    return tuple(Array(a.name, a.shape, a.dtype, True, a.optional) for a in arrays)


SURFELS = (
    Array("centers", "n3"),
    Array("rotations", "n4"),
    Array("scales", "n2"),
    Array("opacities", "n"),
    Array("sh", "nk3"),
)
MAPS = (
    Array("color", "hw3"),
    Array("alpha", "hw"),
    Array("depth", "hw"),
    Array("median", "hw"),
    Array("normal", "hw3", optional=True),
    Array("distortion", "hw", optional=True),
)
FIVE_MAPS = _written(*MAPS[:4], Array("normal", "hw3"))
PINHOLE = ("fx", "fy", "cx", "cy", Array("cam_from_world", "33", np.float64))
CALLS = {
    call.name: call
    for call in (
        Call(
            "rgb_loss",
            (
                Array("rendered", "hw3"),
                Array("target", "hw3"),
                "dssim",
                Array("gradient", "hw3", written=True, optional=True),
            ),
        ),
        Call("pack_normals", (Array("normals", "3n"), Array("codes", "2n", np.int16, True))),
        Call("unpack_normals", (Array("codes", "2n", np.int16), Array("normals", "3n", written=True))),
        Call("depth_normals", (Array("depth", "hw"), *PINHOLE, Array("normal", "hw3", written=True))),
        Call(
            "normal_consistency",
            (
                Array("depth", "hw"),
                Array("alpha", "hw"),
                Array("normal", "hw3"),
                *PINHOLE,
                *_written(
                    Array("grad_depth", "hw"), Array("grad_normal", "hw3"), Array("grad_rotation", "33", np.float64)
                ),
            ),
        ),
        Call(
            "depth_prior",
            (
                Array("depth", "hw"),
                Array("alpha", "hw"),
                Array("prior", "uv"),
                Array("valid", "uv", np.uint8),
                Array("confidence", "uv", optional=True),
                "disparity",
                "align",
                "gradient_weight",
                "levels",
                "step",
                Array("gradient", "hw", written=True),
            ),
        ),
        Call(
            "normal_prior",
            (
                Array("normal", "hw3"),
                Array("alpha", "hw"),
                Array("prior", "uv3"),
                Array("valid", "uv", np.uint8),
                Array("confidence", "uv", optional=True),
                "l1",
                "cosine",
                "step",
                Array("gradient", "hw3", written=True),
            ),
        ),
        Call(
            "forward",
            (
                *SURFELS,
                Array("cam_from_world", "44", np.float64),
                Array("K", "33", np.float64),
                "width",
                "height",
                "near",
                "opacity_floor",
                Array("background", "3"),
                *_written(*MAPS),
            ),
            method=True,
        ),
        Call(
            "backward",
            (
                "view",
                *SURFELS,
                Array("alpha", "hw"),
                Array("depth", "hw"),
                *(Array(f"g_{a.name}", a.shape, optional=True) for a in MAPS),
                *_written(*(Array(f"to_{a.name}", a.shape) for a in SURFELS)),
                *_written(
                    Array("to_center_px", "n2"),
                    Array("to_pose", "44", np.float64),
                    Array("to_K", "33", np.float64),
                    Array("to_background", "3", np.float64, optional=True),
                ),
            ),
            method=True,
        ),
        Call(
            "joint_gradient",
            (
                Array("depth", "kyx"),
                Array("depth_confidence", "kyx"),
                Array("normal", "kyx3"),
                Array("normal_confidence", "kyx"),
                Array("region", "kyx", np.int32),
                Array("region_normal", "kyx3"),
                Array("view_table", "6k"),
                Array("pair_views", "2n", np.int32),
                Array("pair_table", "pn"),
                Array("point_place", "n2"),
                Array("point_off", "n"),
                Array("axes", "33k", optional=True),
                Array("grid", "krr"),
                Array("stiffness", "krr"),
                Array("draws", "ds", np.int32),
                Array("weights", "5"),
                Array("widths", "5"),
                "step",
                "smoothness",
                "magnitude",
                Array("gradient", "krr", written=True),
            ),
        ),
        Call(
            "complete",
            (
                *(Array(name, "kyx", np.float64) for name in ("distance", "anchor", "prior")),
                Array("right", "kyw", np.float64),
                Array("down", "khx", np.float64),
                Array("step_right", "kyw", np.float64),
                Array("step_down", "khx", np.float64),
                "reweightings",
                "least",
                "anchor_width",
                "tie_width",
                Array("result", "kyx", np.float64, True),
            ),
        ),
        Call(
            "depth_of_other_views",
            (
                Array("depth", "f"),
                Array("sure", "f"),
                Array("size", "k2", np.int64),
                Array("near", "kn", np.int64),
                Array("warp", "kn34", np.float64),
                "least",
                "same",
                Array("result", "f", written=True),
                Array("trust", "f", written=True),
            ),
        ),
        Call(
            "count_rays",
            (
                Array("corner", "3", np.float64),
                "side",
                Array("centres", "n3", np.float64),
                Array("first", "m", np.int64),
                Array("ends", "n3", np.float64),
                "from_m",
                "up_to",
                Array("through", "hwk", np.int32, True),
                Array("ended", "hwk", np.int32, True),
            ),
        ),
        Call(
            "seen_through",
            (
                Array("corner", "3", np.float64),
                "side",
                Array("through", "hwk", np.int32),
                Array("ended", "hwk", np.int32),
                Array("xyz", "n3", np.float64),
                "doubt",
                Array("share", "n", np.float64, True),
            ),
        ),
        Call("time_stages", (*SURFELS, *FIVE_MAPS), bench=True),
        Call(
            "bare_loop",
            (*FIVE_MAPS, Array("g_color", "hw3", optional=True), "every", "repeats"),
            bench=True,
        ),
        Call("count_pairs", FIVE_MAPS, bench=True),
        Call("tile_work", ("every", Array("work", "tc", np.float64, True)), bench=True),
    )
}


def numbers(sizes: dict[str, int]) -> dict[str, float]:
    """The arguments that are no arrays."""
    return {
        "dssim": 0.2, "fx": 30.0, "fy": 32.0, "cx": sizes["w"] / 2, "cy": sizes["h"] / 2,
        "width": sizes["w"], "height": sizes["h"], "near": 0.05, "opacity_floor": 1 / 255,
        "every": 2, "repeats": 1, "step": 2,
        "smoothness": 8.0, "magnitude": 0.3, "reweightings": 2, "least": 1e-7, "anchor_width": 0.03, "tie_width": 0.01,
        "same": 0.02, "side": 0.05, "from_m": 0.1, "up_to": 0.95, "doubt": 2.0,
        "disparity": True, "align": True, "gradient_weight": 0.5, "levels": 4, "l1": 0.02, "cosine": 0.01,
    }  # fmt: skip


def filled(array: Array, sizes: dict[str, int], random: np.random.Generator) -> np.ndarray:
    """Sensible values; what is written holds NaN, counts 0."""
    shape = array.lengths(sizes)
    if array.written:
        return np.full(shape, np.nan if np.issubdtype(array.dtype, np.floating) else 0, array.dtype)
    if array.name == "K":
        known = numbers(sizes)
        return np.array([[known["fx"], 0, known["cx"]], [0, known["fy"], known["cy"]], [0, 0, 1.0]])
    if array.name == "cam_from_world":
        return np.eye(shape[0])
    values = random.random(shape)
    if array.name == "draws":
        y, x, k, n = sizes["h"] + 1, sizes["w"] + 1, sizes["k"], sizes["n"]
        region = (k, y, x, 5, 5)
        values *= np.array([k, n, n, y, x, k, max(y - 4, 0), max(x - 4, 0), 2, *region, *region])[:, None]
    if array.name == "size":
        values = np.broadcast_to([sizes["h"], sizes["w"]], shape)
    if array.name == "first":
        values = np.arange(shape[0])
    if array.name == "near":
        values = np.floor(values * (sizes["k"] + 1)) - 1
    if array.name == "valid":
        values *= 4
    if array.name == "region":
        values += 1
    if array.name == "centers":
        values = values * 2 + [-1, -1, 0.5]
    elif array.name in ("rotations", "sh"):
        values = values - 0.5
    return values.astype(array.dtype, order="C")


def arguments(call: Call, sizes: dict[str, int], seed: int = 0) -> dict[str, object]:
    """All arguments of a call that fit, by name; `view` is left to the frame's forward pass."""
    random = np.random.default_rng(seed)
    known = numbers(sizes)
    return {
        **{name: known.get(name) for name in call.arguments if isinstance(name, str)},
        **{array.name: filled(array, sizes, random) for array in call.arrays()},
    }


def run(call: Call, values: dict[str, object], sizes: dict[str, int], seed: int = 0) -> object:
    """Calls it, after a forward pass of the same surfels where it needs one."""
    frame = _C.RasterFrame()
    if call.after_forward():
        view = frame.forward(**arguments(CALLS["forward"], sizes, seed))
        if "view" in values and values["view"] is None:
            values = {**values, "view": view}
    return call.of(frame)(**values)
