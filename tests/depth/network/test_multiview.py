"""A network that sees several photos with their poses: what it is given, and what becomes of what it gives.

It is told where each pixel is in the world by the photo's colour, and finds depth by the poses that it gets: with other
poses, or those of other photos, its depth is wrong.
"""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from room2dgs.config import conf_dir, load_config
from room2dgs.config.card import FOLDER, read_card
from room2dgs.depth import depth_of_frames
from room2dgs.depth.network.map_cache import read_array
from room2dgs.depth.network.maps import read_models
from room2dgs.depth.network.multiview_maps import multiview_maps
from room2dgs.depth.network.windows import windows
from room2dgs.errors import InputError
from tests.depth.conftest import ROOM

FOCAL = 55.0  # for which the network is exact: at others it errs by the focal length
SPAN = float(ROOM.max()) + 1  # metres for which 0..255 stands, from half a metre below 0 on
COUNT = 3


@pytest.fixture
def sighted(onnx_file):
    """`sighted(...)` writes the network; its pose input is called "poses"."""

    def write(inverse=False, count=COUNT, declared=COUNT, rows=4, output="all", name="sighted.onnx"):
        batch = [("Slice", ["pose", "row", "row_end", "axis"], ["third"], {})]  # (1, V, 1, 4)
        if inverse:  # z = R[:, 2] . (X - c)
            batch = [
                ("Slice", ["pose", "column", "column_end", "last"], ["third0"], {}),
                ("Slice", ["pose", "t_column", "t_end", "last"], ["centre0"], {}),
                ("Slice", ["third0", "zero", "three", "axis"], ["third1"], {}),
                ("Slice", ["centre0", "zero", "three", "axis"], ["centre1"], {}),
                ("Mul", ["third1", "centre1"], ["along"], {}),
                ("ReduceSum", ["along", "axis"], ["away"], {"keepdims": 1}),
                ("Neg", ["away"], ["shift"], {}),
                ("Concat", ["third1", "shift"], ["third"], {"axis": 2}),
            ]
        nodes = [
            *batch,
            ("Reshape", ["third", "five"], ["plane"], {}),  # (1, V, 4, 1, 1)
            ("Mul", ["photo", "span"], ["scaled"], {}),
            ("Sub", ["scaled", "half"], ["xyz"], {}),
            ("Split", ["plane", "split"], ["normal", "offset"], {"axis": 2}),
            ("Mul", ["normal", "xyz"], ["terms"], {}),
            ("ReduceSum", ["terms", "two"], ["sum"], {"keepdims": 1}),
            ("Add", ["sum", "offset"], ["z"], {}),
            ("Slice", ["K", "zero", "one", "axis"], ["K0"], {}),
            ("Slice", ["K0", "zero", "one", "last"], ["fx"], {}),
            ("Div", ["fx", "focal"], ["factor4"], {}),
            ("Unsqueeze", ["factor4", "last"], ["factor0"], {}),
            ("Reshape", ["factor0", "four_axes"], ["factor"], {}),
            ("Mul", ["z", "factor"], ["all"], {}),
            ("Div", ["one_f", "all"], ["sure"], {}),
            ("Slice", ["all", "zero", "one", "one"], ["first"], {}),
        ]
        ints = dict(row=[2], row_end=[3], axis=[2], last=[3], column=[2], column_end=[3], t_column=[3], t_end=[4])
        ints |= dict(zero=[0], one=[1], two=[2], three=[3], split=[3, 1], five=[1, count, 4, 1, 1])
        ints |= dict(four_axes=[1, count, 1, 1, 1])
        constants = {key: np.array(value, np.int64) for key, value in ints.items()}
        floats = dict(span=SPAN, half=0.5, focal=FOCAL, one_f=1.0)
        constants |= {key: np.float32(value) for key, value in floats.items()}
        nodes = [(kind, [{"pose": "poses"}.get(one, one) for one in source], *rest) for kind, source, *rest in nodes]
        inputs = {
            "photo": ("FLOAT", (1, declared, 3, "h", "w")),
            "poses": ("FLOAT", (1, declared, rows, 4)),
            "K": ("FLOAT", (1, declared, 3, 3)),
        }
        return onnx_file(nodes, inputs, {output: ("FLOAT", None), "sure": ("FLOAT", None)}, constants, name)

    return write


@pytest.fixture
def sights(room, photos):
    """Frames whose photos say where each pixel is, each with a focal length of its own."""
    images = []
    for frame, depth in zip(room.frames, room.depths, strict=True):
        xyz = frame.camera.unproject_map(depth)
        images.append(np.round(255 * ((xyz + 0.5) / SPAN).clip(0, 1)).astype(np.uint8))
    return photos(images)


@pytest.fixture
def prior(tmp_path):
    """`prior(model, **views)`: settings with a card that says so."""

    def make(model, views=(), depth=(), settings=(), **inputs):
        card = {
            "card": 1,
            "input": {"name": "photo", "intrinsics": "K", "height": 60, "width": 80, **inputs},
            "views": {"poses": "poses", "origin": "world", **dict(views)},
            "depth": {"meaning": "metric_depth", "output": "all", "confidence": "sure", **dict(depth)},
        }
        path = model.with_suffix(".json")
        path.write_text(json.dumps(card))
        given = [f"prior.depth.model={model}", f"prior.cache={tmp_path / 'cache'}", *settings]
        return load_config(["scene.path=a", "out=b", "prior=none", "prior/depth=onnx_multiview", *given]).prior

    return make


def maps(frames, config):
    said: list[str] = []
    found = multiview_maps(frames, config, read_models(config)["depth"], said.append)
    return {name: read_array(path, "map") for name, path in found.items()}, "\n".join(said)


def errors(room, found, focal=60.0):
    """Median relative error of each photo; infinite without a map."""
    return [
        float(np.median(np.abs(found[frame.name] * FOCAL / focal / depth - 1))) if frame.name in found else np.inf
        for frame, depth in zip(room.frames, room.depths, strict=True)
    ]


ROUNDING = 0.01  # SPAN / 255 of 2 m


@pytest.mark.parametrize(("inverse", "pose"), [(False, "cam_from_world"), (True, "world_from_cam")])
def test_each_photo_goes_in_with_its_own_pose_and_intrinsics(room, sights, sighted, prior, inverse, pose):
    model = sighted(inverse, rows=4 if inverse else 3)
    assert max(errors(room, maps(sights, prior(model, {"pose": pose}))[0])) < ROUNDING
    other = {"cam_from_world": "world_from_cam", "world_from_cam": "cam_from_world"}[pose]
    assert min(errors(room, maps(sights, prior(model, {"pose": other}))[0])) > 5 * ROUNDING
    assert np.median(errors(room, maps(sights, prior(model, {"pose": pose, "origin": "first"}))[0])) > 5 * ROUNDING


def test_intrinsics_are_those_of_the_photo_in_the_input(room, sights, sighted, prior):
    """Twice as large an input has twice the focal length, and so twice the depth of this network."""
    found, _ = maps(sights, prior(sighted(), height=120, width=160))
    assert max(errors(room, found, focal=120.0)) < 1.5 * ROUNDING
    focal = [40.0 + 5 * index for index in range(len(sights))]
    frames = [
        replace(frame, camera=replace(frame.camera, K=np.diag([f / 60.0, 1, 1]) @ frame.camera.K))
        for frame, f in zip(sights, focal, strict=True)
    ]
    found, _ = maps(frames, prior(sighted(name="again.onnx")))
    for frame, f, depth in zip(frames, focal, room.depths, strict=True):
        assert np.median(np.abs(found[frame.name] * FOCAL / f / depth - 1)) < 1.5 * ROUNDING


def test_of_a_network_that_answers_for_the_first_photo_each_photo_is_the_first_once(room, sights, sighted, prior):
    model = sighted(output="first")
    found, said = maps(sights, prior(model, {"answers": "first"}, {"output": "first", "confidence": None}))
    assert max(errors(room, found)) < ROUNDING and "6 of 6 windows" in said


def test_the_poses_of_a_window_are_relative_to_its_first_photo(room, photos, sighted, prior):
    """All photos in one window, coloured by where each pixel is in the first one's camera."""
    count = len(room.frames)
    first = windows([frame.camera for frame in room.frames], count, "first")[0].views[0]
    camera = room.frames[first].camera
    images = []
    for frame, depth in zip(room.frames, room.depths, strict=True):
        there = camera.to_camera(frame.camera.unproject_map(depth).reshape(-1, 3)).reshape(60, 80, 3)
        images.append(np.round(255 * ((there + 5) / 11).clip(0, 1)).astype(np.uint8))
    model = sighted(count=count, declared=count)
    # the network's own span and offset are another: the photo's values are brought to it
    stretch = {"mean": [0.5 * 9 / 11] * 3, "std": [SPAN / 11] * 3}
    found, _ = maps(photos(images), prior(model, {"origin": "first"}, **stretch))
    answered = windows([frame.camera for frame in room.frames], count, "all")[0].answers
    some = errors(room, found)
    assert first in answered and max(some[index] for index in answered) < 0.03


def test_a_second_time_nothing_runs_and_another_pose_makes_new_maps(room, sights, sighted, prior):
    config = prior(sighted())
    first, said = maps(sights, config)
    assert " 0 of " not in said
    again, said = maps(sights, config)
    assert " 0 of " in said
    assert all(first[name].tobytes() == again[name].tobytes() for name in first)
    moved = sights[0].camera.cam_from_world.copy()
    moved[2, 3] += 0.5
    frames = [replace(sights[0], camera=replace(sights[0].camera, cam_from_world=moved)), *sights[1:]]
    other, said = maps(frames, config)
    assert " 0 of " not in said
    wrong = np.median(other[sights[0].name] - first[sights[0].name])
    assert abs(wrong - 0.5 * 60 / FOCAL) < 0.05


@pytest.mark.parametrize(
    ("declared", "views", "said"),
    [
        (2, {"count": 4}, r"was exported for 2 photos at a time and gives wrong numbers for views\.count=4"),
        ("views", {}, r"takes any number of photos, but gives wrong numbers .* give that as views\.count"),
        (1, {}, "sees one photo at a time; give prior/depth=onnx"),
        (9, {}, "sees 9 photos at a time and there are 6"),
        (COUNT, {"poses": "pose"}, r"views\.poses=pose in the card is not in .*sighted\.onnx; it has in: photo"),
        (COUNT, {"poses": None}, "takes photo, poses: name what is not the photos"),
    ],
)
def test_a_file_of_another_number_of_photos_is_refused(sights, sighted, prior, declared, views, said):
    with pytest.raises(InputError, match=said):
        maps(sights, prior(sighted(count=declared if declared in (1, 2, 9) else COUNT, declared=declared), views))


def test_a_file_that_fixes_no_number_takes_the_cards(room, sights, sighted, prior):
    found, _ = maps(sights, prior(sighted(declared="views"), {"count": COUNT}))
    assert max(errors(room, found)) < ROUNDING


def test_an_answer_of_the_first_alone_is_told(sights, sighted, prior):
    model = sighted(output="first")
    with pytest.raises(InputError, match="no maps of 3 photos; if it is of the first alone"):
        maps(sights, prior(model, depth={"output": "first", "confidence": None}))


def test_its_depth_is_aligned_and_trusted_by_its_calibrated_error(room, sights, sighted, prior):
    said: list[str] = []
    priors = depth_of_frames(sights, room.points, prior(sighted(), depth={"meaning": "scaled_depth"}), said.append)
    assert priors.label == priors.depth_source == "onnx_multiview"
    for frame, depth in zip(room.frames, room.depths, strict=True):
        assert np.median(np.abs(priors.by_frame[frame.name].depth / depth - 1)) < ROUNDING
    assert any("where it is sure it is" in line for line in said)


def test_a_card_of_several_photos_is_not_one_of_one(sighted, prior):
    model = sighted()
    prior(model)
    with pytest.raises(InputError, match="several photos at a time; give prior/depth=onnx_multiview"):
        load_config(["scene.path=a", "out=b", "prior=none", "prior/depth=onnx", f"prior.depth.model={model}"])
    model.with_suffix(".json").write_text('{"card": 1, "depth": {"meaning": "metric_depth"}}')
    given = ["prior=none", "prior/depth=onnx_multiview", f"prior.depth.model={model}"]
    with pytest.raises(InputError, match="one photo at a time; give prior/depth=onnx"):
        load_config(["scene.path=a", "out=b", *given])


@pytest.mark.parametrize("name", ["depth_anything_3", "map_anything"])
def test_known_networks_get_what_their_makers_say(name):
    card = read_card(conf_dir() / FOLDER / f"{name}.json")
    assert card.views and card.views.poses and card.input.intrinsics and card.depth and card.depth.confidence
    assert (card.input.multiple, card.input.std[0]) == (14, 0.229) and card.views.count is None
