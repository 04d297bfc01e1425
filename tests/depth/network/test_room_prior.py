"""prior=room_prior from photos to weighted priors, with a stand-in for the network that is shipped."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import onnxruntime
import pytest

from room2dgs.captures.point_cloud import PointCloud
from room2dgs.config import load_config
from room2dgs.depth import depth_of_frames
from room2dgs.depth.joint.optimise import STAGES
from room2dgs.depth.network.model_file import read_model
from room2dgs.errors import InputError

NO_POINTS = PointCloud(np.zeros((0, 3)), np.zeros((0, 3), np.uint8))


@pytest.fixture
def runs(monkeypatch):
    """The outputs that each run of a network was asked for."""
    asked = []

    class Session(onnxruntime.InferenceSession):
        def run(self, names, *args):
            asked.append(names)
            return super().run(names, *args)

    monkeypatch.setattr(onnxruntime, "InferenceSession", Session)
    return asked


@pytest.fixture
def settings(prior_config, room_network, tmp_path):
    """Default settings with another network, without flip augmentation and the slow joint optimisation."""

    def make(**changes):
        network = {"model": room_network, "card__width": 320, "card__height": 240, "card__flip": False}
        both = {f"{kind}__{key}": value for kind in ("depth", "normal") for key, value in network.items()}
        changes = {"cache": tmp_path / "cache", "depth__joint": "false"} | both | changes
        return prior_config("prior=room_prior", **changes)

    return make


def loaded(frames, points, config):
    lines: list[str] = []
    return depth_of_frames(frames, points, config, lines.append), "\n".join(lines)


def test_one_inference_of_each_photo_gives_depth_normals_and_confidences(
    room, coded_photos, settings, runs, room_network
):
    priors, said = loaded(coded_photos, room.points, settings())
    assert len(runs) == len(coded_photos)
    assert all(set(names) == {"depth", "depth_error", "normal", "normal_error"} for names in runs)
    assert "depth and normal prior: 6 photos" in said
    for index, frame in enumerate(coded_photos):
        prior = priors.by_frame[frame.name]
        known = prior.depth > 0
        assert known.mean() > 0.97
        # 8 bits of inverse depth are good to 1 % at 4 m
        assert np.median(np.abs(prior.depth / room.depths[index] - 1)[known]) < 0.01
        expected = room.normals[index] @ frame.camera.cam_from_world[:3, :3]
        assert np.median((prior.normal * expected).sum(axis=-1)[prior.normal.any(axis=-1)]) > 0.999
        np.testing.assert_allclose(
            prior.normal_confidence[prior.normal.any(axis=-1)], 1 / (1 + (0.1 / 0.35) ** 2), atol=2e-3
        )
        near, far = (side & known for side in (room.depths[index] < 2.2, room.depths[index] > 2.8))
        worth = worth_of(priors, frame.name)
        assert np.median(prior.depth_confidence[near]) == pytest.approx(worth / (1 + 0.2**2), abs=2e-3)  # 8 bits
        assert np.median(prior.depth_confidence[far]) == pytest.approx(worth / (1 + 3.0**2), abs=2e-3)
    assert priors.label == "room_prior"
    digest = read_model(room_network).digest
    assert priors.networks == {"depth": digest, "normal": digest}


def worth_of(priors, name: str) -> float:
    """What the fit to the points leaves of a map's confidence."""
    return 1 / (1 + (priors.fits[name].residual / 0.1) ** 2)


def test_cached_maps_serve_other_error_scales(room, coded_photos, settings, runs):
    first, _ = loaded(coded_photos, room.points, settings())
    runs.clear()
    name = coded_photos[0].name
    again, _ = loaded(coded_photos, room.points, settings())
    for one, other in zip(first.by_frame[name], again.by_frame[name], strict=True):
        np.testing.assert_array_equal(one, other)
    strict, _ = loaded(coded_photos, room.points, settings(depth__error_scale=0.3, depth__max_error=0.2))
    prior, far = strict.by_frame[name], room.depths[0] > 2.8
    assert not prior.depth[far].any() and prior.depth[~far].any()
    near = (prior.depth > 0) & (room.depths[0] < 2.2)
    assert np.median(prior.depth_confidence[near]) == pytest.approx(
        worth_of(strict, name) / (1 + (0.02 / 0.3) ** 2), abs=2e-3
    )
    assert not runs


@pytest.mark.parametrize(
    "changes",
    [
        {"normal__card__width": 160, "normal__card__height": 120},
        {"normal__card__flip": "true"},
        {"depth__card__mean": "[0,0.1,0]"},
    ],
)
def test_other_inputs_are_other_inferences(room, coded_photos, settings, runs, changes):
    loaded(coded_photos, room.points, settings(**changes))
    depth, normal = ({kind, f"{kind}_error"} for kind in ("depth", "normal"))
    assert [set(names) for names in runs].count(depth) == len(coded_photos)
    assert [set(names) for names in runs].count(normal) >= len(coded_photos)
    assert depth | normal not in [set(names) for names in runs]


def test_one_kind_alone_is_all_that_is_computed(room, coded_photos, settings, runs):
    priors, _ = loaded(coded_photos, room.points, settings(depth__source="none"))
    assert all(set(names) == {"normal", "normal_error"} for names in runs)
    prior = priors.by_frame[coded_photos[0].name]
    assert prior.depth is None and prior.depth_confidence is None and prior.normal_confidence is not None
    assert set(priors.networks) == {"normal"}


def test_without_its_error_a_network_weighs_nothing(room, coded_photos, settings):
    names = {f"{kind}__card__error_output": None for kind in ("depth", "normal")}
    priors, _ = loaded(coded_photos, room.points, settings(**names))
    prior = priors.by_frame[coded_photos[0].name]
    assert prior.normal_confidence is None
    assert (prior.depth > 0).mean() > 0.99
    # the same everywhere: what its fit to the points says of the map
    worth = worth_of(priors, coded_photos[0].name)
    np.testing.assert_allclose(prior.depth_confidence[prior.depth > 0], worth, atol=2e-3)


@pytest.mark.parametrize("joint", ["false", "true"])
@pytest.mark.parametrize("count", [0, 5])
def test_metres_need_no_points(room, coded_photos, settings, count, joint, monkeypatch):
    monkeypatch.setattr("room2dgs.depth.joint.optimise.STAGES", STAGES[:1])
    points = PointCloud(room.points.xyz[:count], room.points.rgb[:count]) if count else NO_POINTS
    priors, said = loaded(coded_photos[:3], points, settings(depth__joint=joint))
    assert "its metres are taken with a scale of 1" in said
    assert "nan" not in said
    for index, frame in enumerate(coded_photos[:3]):
        prior = priors.by_frame[frame.name]
        assert np.median(np.abs(prior.depth / room.depths[index] - 1)[prior.depth > 0]) < 0.05


def test_few_points_of_many_views_tell_one_scale(room, coded_photos, settings):
    xyz = 1.25 * room.points.xyz[::16]  # a few a view
    frames = [
        replace(frame, camera=replace(frame.camera, cam_from_world=_moved(frame.camera.cam_from_world, 1.25)))
        for frame in coded_photos
    ]
    points = PointCloud(xyz, np.zeros((len(xyz), 3), np.uint8))
    priors, _ = loaded(frames, points, settings())
    assert 0 < max(fit.points for fit in priors.fits.values()) < 30
    assert [fit.scale for fit in priors.fits.values()] == pytest.approx([1.25] * 6, rel=0.03)


def _moved(pose: np.ndarray, factor: float) -> np.ndarray:
    return pose * np.array([[1, 1, 1, factor]] * 3 + [[1, 1, 1, 1]])


def test_metres_that_are_off_are_aligned_to_the_points(room, coded_photos, settings):
    frames = [
        replace(frame, camera=replace(frame.camera, cam_from_world=_moved(frame.camera.cam_from_world, 1.3)))
        for frame in coded_photos
    ]
    points = replace(room.points, xyz=1.3 * room.points.xyz)
    priors, _ = loaded(frames, points, settings())
    assert [fit.scale for fit in priors.fits.values()] == pytest.approx([1.3] * 6, rel=0.02)


def test_a_wrong_shape_has_little_weight(room, settings, photos):
    rng = np.random.default_rng(0)
    noise = photos([rng.integers(20, 250, (60, 80, 3), dtype=np.uint8) for _ in room.frames])
    priors, _ = loaded(noise, room.points, settings(normal__source="none"))
    assert max(float(maps.depth_confidence.max()) for maps in priors.by_frame.values()) < 0.3


def test_it_can_be_chosen_by_kind_and_turned_off(tmp_path):
    given = ["scene.path=a", "out=b"]
    both = load_config([*given, "prior=room_prior"]).prior
    assert (both.depth.source, both.normal.source) == ("room_prior", "room_prior")
    assert (both.depth.model, both.normal.model) == (None, None)
    mixed = load_config([*given, "prior=none", "prior/normal=room_prior"]).prior
    assert (mixed.depth.source, mixed.normal.source) == ("none", "room_prior")
    mixed = load_config([*given, "prior=room_prior", "prior/depth=files", "prior.depth.path=d"]).prior
    assert (mixed.depth.source, mixed.normal.source) == ("files", "room_prior")
    off = load_config([*given, "prior=none"]).prior
    assert (off.depth.source, off.normal.source) == ("none", "none")
    for experiment, sources in (("no_depth", ("none", "room_prior")), ("no_normal", ("room_prior", "none"))):
        prior = load_config([*given, "prior=room_prior", f"experiment={experiment}"]).prior
        assert (prior.depth.source, prior.normal.source) == sources
    plain = load_config([*given, "prior=room_prior", "experiment=plain_2dgs"]).prior
    assert (plain.depth.source, plain.normal.source) == ("none", "none")


@pytest.mark.parametrize(
    ("overrides", "said"),
    [
        (["prior=none", "prior.depth.source=room_prior"], "write prior/depth=room_prior"),
        (["prior=room_prior", "prior.normal.encoding=png8"], "prior.normal.source=room_prior makes maps of numbers"),
        (
            ["prior=room_prior", "prior.normal.frame=world"],
            "frame=world does not fit a network that sees mirrored photos",
        ),
        (["prior=room_prior", "prior.depth.error_scale=0"], "prior.depth.error_scale=0 is impossible"),
        (["prior=room_prior", "prior.normal.max_error=nan"], "prior.normal.max_error=nan is impossible"),
        (["loss.normal_reweighting.last_deg=0"], "loss.normal_reweighting.last_deg=0 is impossible"),
    ],
)
def test_settings_that_cannot_be_are_one_sentence(overrides, said):
    with pytest.raises(InputError) as refused:
        load_config(["scene.path=a", "out=b", *overrides])
    assert said in str(refused.value) and "\n" not in str(refused.value)


def test_an_installation_without_the_network_says_so(room, prior_config, tmp_path, monkeypatch):
    monkeypatch.setattr("room2dgs.depth.network.shipped.NAME", "another.onnx")
    with pytest.raises(InputError, match=r"another\.onnx is missing from this installation.*prior=none"):
        depth_of_frames(room.frames, room.points, prior_config("prior=room_prior", cache=tmp_path))
