"""From photos through a network to aligned priors, and a second time from the disk alone."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import onnxruntime
import pytest

from room2dgs.config import conf_dir, load_config
from room2dgs.config.overrides import group_choices
from room2dgs.depth import depth_of_frames
from room2dgs.depth.network.map_cache import read_array
from room2dgs.depth.network.maps import photos_at_once, predicted_maps, read_models
from room2dgs.depth.network.model_file import ModelFile
from room2dgs.errors import InputError
from tests.depth.cards import write_card

DISPARITY = 200.0  # of 8-bit photos: grey level = DISPARITY / depth


@pytest.fixture
def grey(room):
    """Photos whose grey level is the inverse depth."""
    greys = [np.clip(np.round(DISPARITY / depth), 1, 255).astype(np.uint8) for depth in room.depths]
    return [np.repeat(grey[..., None], 3, axis=2) for grey in greys]


@pytest.fixture
def sessions(monkeypatch):
    """The models that were opened."""
    opened = []
    session = onnxruntime.InferenceSession
    monkeypatch.setattr(
        onnxruntime, "InferenceSession", lambda path, *args, **kw: opened.append(path) or session(path, *args, **kw)
    )
    return opened


@pytest.fixture
def depth_config(prior_config, depth_network, tmp_path):
    def make(**changes):
        changes = {"model": depth_network, "card__height": 60, "card__width": 80, "card__white": 255} | changes
        depth = {f"depth__{key}": value for key, value in changes.items()}
        return prior_config("prior/depth=onnx", cache=tmp_path / "cache", **depth)

    return make


def maps(frames, config):
    lines: list[str] = []
    paths = predicted_maps(frames, "depth", config, read_models(config), lines.append)
    return {name: read_array(path, "map") for name, path in paths.items()}, "\n".join(lines)


def test_a_networks_disparity_becomes_metres(room, photos, grey, depth_config, sessions):
    frames = photos(grey)
    lines: list[str] = []
    priors = depth_of_frames(frames, room.points, depth_config(), lines.append)
    assert priors.label == "onnx"
    for i, frame in enumerate(frames):
        # the grey levels' rounding alone is 1 % of the far walls' disparity
        assert np.median(np.abs(priors.by_frame[frame.name].depth / room.depths[i] - 1)) < 0.01
    assert len(sessions) == 1


def test_a_second_run_opens_no_model_and_gives_the_same_bits(room, photos, grey, depth_config, sessions):
    frames = photos(grey)
    first, _ = maps(frames, depth_config())
    again, said = maps(frames, depth_config(card__get="elsewhere", manhattan=False))
    assert len(sessions) == 1 and "all 6 maps of mean.onnx are in" in said
    assert {name: values.tobytes() for name, values in first.items()} == {n: v.tobytes() for n, v in again.items()}


@pytest.mark.parametrize(
    ("threads", "megabytes", "provider", "expected"),
    [
        (1, 1, "cpu", (1, 1)),
        (2, 1, "cpu", (2, 1)),
        (16, 1, "cpu", (4, 4)),
        (16, 400, "cpu", (1, 16)),
        (16, 1, "cuda", (1, 16)),
    ],
)
def test_small_networks_pass_at_photos_side_by_side(depth_config, threads, megabytes, provider, expected):
    model = ModelFile(Path("a.onnx"), "0", megabytes * 10**6)
    assert photos_at_once(model, replace(depth_config(), threads=threads, provider=provider)) == expected


def test_photos_side_by_side_get_the_maps_that_they_get_one_by_one(room, photos, grey, depth_config, tmp_path):
    frames, found = photos(grey), []
    for threads in (1, 3):
        config = replace(depth_config(), threads=threads, cache=str(tmp_path / f"of_{threads}"))
        found.append({name: values.tobytes() for name, values in maps(frames, config)[0].items()})
    assert len(found[0]) == 6 and found[0] == found[1]


def test_the_model_may_move_but_must_be_there(room, photos, grey, depth_config, depth_network, sessions):
    frames = photos(grey)
    maps(frames, depth_config())
    moved = depth_network.rename(depth_network.with_name("moved.onnx"))
    maps(frames, depth_config(model=moved))
    assert len(sessions) == 1
    with pytest.raises(InputError, match=r"mean\.onnx is not there"):
        maps(frames, depth_config())


def test_only_what_changed_is_computed_again(room, photos, grey, depth_config, depth_network, onnx_file):
    frames = photos(grey)
    maps(frames, depth_config())
    grey[2] = 255 - grey[2]
    changed, said = maps(photos(grey), depth_config())
    assert "mean.onnx on 1 photos; 5 of its maps" in said
    np.testing.assert_allclose(changed[frames[2].name], grey[2][..., 0], rtol=1e-3)
    assert "on 6 photos; 0 of" in maps(frames, depth_config(card__white=1))[1]
    assert "on 6 photos; 0 of" in maps(frames, depth_config(card__mean="[1,0,0]"))[1]
    other = [("ReduceMax", ["photo"], ["map"], {"axes": [1], "keepdims": 1})]
    onnx_file(other, name="mean.onnx")
    assert "on 6 photos; 0 of" in maps(frames, depth_config())[1]


def test_another_working_size_has_maps_of_its_own(room, photos, grey, depth_config):
    frames = photos(grey)
    maps(frames, depth_config())
    small = [replace(frame, camera=frame.camera.resized(40, 30)) for frame in frames]
    values, said = maps(small, depth_config())
    assert "on 6 photos; 0 of" in said
    assert values[frames[0].name].shape == (30, 40)
    assert "all 6 maps" in maps(frames, depth_config())[1]


def test_a_damaged_map_is_made_again(room, photos, grey, depth_config, tmp_path):
    frames = photos(grey)
    first, _ = maps(frames, depth_config())
    path = next((tmp_path / "cache" / "depth").glob(f"{frames[3].name}-*.npz"))
    path.write_bytes(path.read_bytes()[:200])
    again, said = maps(frames, depth_config())
    assert "on 1 photos; 5 of its maps" in said
    np.testing.assert_array_equal(again[frames[3].name], first[frames[3].name])


def test_maps_that_half_precision_cannot_hold_are_cached_in_full(room, photos, grey, depth_config, onnx_file):
    nodes = [("ReduceMean", ["photo"], ["m"], {"axes": [1], "keepdims": 1}), ("Mul", ["m", "k"], ["map"], {})]
    model = onnx_file(nodes, constants={"k": np.float32(1e4)})
    values, _ = maps(photos(grey), depth_config(model=model))
    np.testing.assert_allclose(next(iter(values.values())), 1e4 * grey[0][..., 0], rtol=1e-3)


def test_a_photo_in_which_the_network_sees_nothing_is_left_out_and_said(room, photos, grey, depth_config, sessions):
    grey[1][:] = 0
    frames = photos(grey)
    for _ in range(2):
        found, said = maps(frames, depth_config())
        assert set(found) == {frame.name for frame in frames} - {frames[1].name}
        assert f"no valid pixel in 1 of 6 photos: {frames[1].name}" in said
    assert len(sessions) == 1


def test_a_network_that_sees_nothing_at_all_is_an_error(room, photos, depth_config):
    with pytest.raises(InputError, match=r"mean\.onnx gives no valid pixel for any of 6 photos"):
        maps(photos([np.zeros((60, 80, 3), np.uint8)] * 6), depth_config())


def test_maps_done_before_an_error_are_cached_and_nothing_half_written(room, photos, grey, depth_config, tmp_path):
    frames = photos(grey)
    frames[4].color_path.write_bytes(b"no photo")
    with pytest.raises(InputError, match=frames[4].color_path.name):
        maps(frames, depth_config())
    kept = {path.name[:6] for path in (tmp_path / "cache" / "depth").iterdir()}
    assert {frame.name for frame in frames[:4]} <= kept  # photos that were begun beside it are finished
    assert frames[4].name not in kept


def test_a_cache_that_cannot_be_written_is_named(room, photos, grey, depth_config, tmp_path):
    (tmp_path / "cache").write_text("a file in its place")
    with pytest.raises(InputError, match=r"cannot be written .*; choose another prior\.cache=DIR"):
        maps(photos(grey), depth_config())


def test_a_networks_normals_are_read_and_a_wrong_convention_is_its_own(room, photos, onnx_file, prior_config, tmp_path):
    frames = photos([np.round((normal + 1) * 127.5).astype(np.uint8) for normal in room.normals])
    model = onnx_file([("Identity", ["photo"], ["map"], {})])

    def load(**changes):
        changes |= {"model": model, "card__height": 60, "card__width": 80, "card__values": "zero_to_one"}
        normal = {f"normal__{key}": value for key, value in changes.items()}
        settings = prior_config("prior/normal=onnx", cache=tmp_path / "cache", **normal)
        return depth_of_frames(frames, room.points, settings, lambda line: None)

    priors = load()
    expected = room.normals[1] @ frames[1].camera.cam_from_world[:3, :3]
    prior = priors.by_frame[frames[1].name]
    assert (prior.normal * expected).sum(axis=-1)[prior.normal.any(axis=-1)].min() > 0.999
    assert prior.normal.any(axis=-1).mean() > 0.99
    with pytest.raises(InputError, match=r"model\.onnx has its normals in another convention .*facing=camera fits"):
        load(facing="away")


def test_a_wrong_convention_is_reported_before_all_photos_are_computed(
    room, photos, onnx_file, prior_config, tmp_path, monkeypatch
):
    monkeypatch.setattr("room2dgs.depth.normals.stage.CHECKED_FRAMES", 3)
    frames = photos([np.round((normal + 1) * 127.5).astype(np.uint8) for normal in room.normals])
    model = onnx_file([("Identity", ["photo"], ["map"], {})], {"photo": ("FLOAT", (1, 3, 60, 80))})
    choice = ("prior/normal=onnx", "prior.normal.axes=opengl")
    card = {"normal__model": model, "normal__card__values": "zero_to_one"}
    settings = prior_config(*choice, cache=tmp_path / "cache", **card)
    with pytest.raises(InputError, match="another convention"):
        depth_of_frames(frames, room.points, settings, lambda line: None)
    assert len(list((tmp_path / "cache" / "normal").glob("*.npz"))) == 3


def test_simulated_files_beside_a_network_stay_labelled(
    room, photos, grey, depth_network, map_files, prior_config, tmp_path
):
    folder = map_files()
    (folder / "priors.json").write_text(json.dumps({"simulated": True}))
    onnx = {"depth__model": depth_network, "depth__card__height": 60, "depth__card__width": 80}
    settings = prior_config(
        "prior/depth=onnx", "prior/normal=files", cache=tmp_path / "cache", normal__path=folder / "normal", **onnx
    )
    assert depth_of_frames(photos(grey), room.points, settings, lambda line: None).label == "simulated"


CHOICES = [(kind, name) for kind in ("depth", "normal") for name in group_choices(conf_dir())[f"prior/{kind}"]]


@pytest.mark.parametrize(
    ("kind", "name"),
    [choice for choice in CHOICES if choice[1] not in ("none", "files", "room_prior", "sensor", "auto")],
)
def test_every_ready_configuration_wants_a_model_and_says_which(kind, name, tmp_path):
    given = ["scene.path=a", "out=b", f"prior/{kind}={name}"]
    with pytest.raises(InputError, match=rf"^prior\.{kind}\.model=FILE is not given; get \S+ "):
        load_config(given)
    if name in ("onnx", "onnx_multiview"):
        card = write_card(tmp_path / "card.json", kind, {})
        if name == "onnx_multiview":
            several = {"views": {"poses": "poses", "origin": "world"}}
            card.write_text(json.dumps(json.loads(card.read_text()) | several))
        given.append(f"prior.{kind}.card={card}")
    part = getattr(load_config([*given, f"prior.{kind}.model=a=b.onnx"]).prior, kind)
    several = name in ("depth_anything_3", "map_anything", "onnx_multiview")
    assert (part.source, part.model) == ("onnx_multiview" if several else "onnx", "a=b.onnx")


@pytest.mark.parametrize(
    ("override", "said"),
    [
        ("prior/depth=dsine", "prior/depth=dsine is not known; choose from auto, depth_anything_3"),
        ("prior/depth=_base", "prior/depth=_base is not known"),
        ("prior.normal=dsine", "write prior/normal=dsine"),
        ("prior/dept=dsine", "did you mean prior/depth"),
        (
            "prior.depth.network=moge_3",
            "prior.depth.network=moge_3 is not known (did you mean moge_2?); choose from bae",
        ),
        ("prior.provider=tpu", "choose from auto, cpu, cuda"),
    ],
)
def test_wrong_settings_of_a_network_are_one_sentence(override, said):
    with pytest.raises(InputError) as refused:
        load_config(["scene.path=a", "out=b", override])
    assert said in str(refused.value) and "\n" not in str(refused.value)


def test_a_kind_of_prior_can_be_chosen_alone_and_on_an_earlier_run(tmp_path):
    from room2dgs.config import dump_config

    choice = ["prior=none", "prior/depth=tcmonodepth", "prior.depth.model=m.onnx"]
    earlier = load_config(["scene.path=a", "out=b", *choice])
    assert (earlier.prior.depth.source, earlier.prior.normal.source) == ("onnx", "none")
    (tmp_path / "config.yaml").write_text(dump_config(earlier))
    again = load_config(["prior/normal=files", "prior.normal.path=n"], tmp_path / "config.yaml")
    assert (again.prior.depth, again.prior.normal.source) == (earlier.prior.depth, "files")
    assert load_config(["prior/depth=none"], tmp_path / "config.yaml").prior.depth.source == "none"


def test_the_photo_is_seen_at_its_full_size(room, photos, grey, depth_config):
    frames = photos(grey)
    fine = cv2.resize(grey[0], (160, 120), interpolation=cv2.INTER_NEAREST)
    fine[::2] = 0
    cv2.imwrite(str(frames[0].color_path), fine)
    config = depth_config(card__height=120, card__width=160)
    values, _ = maps([replace(frames[0], camera=frames[0].camera.resized(160, 120))], config)
    np.testing.assert_allclose(values[frames[0].name], fine[..., 0], rtol=1e-3)
