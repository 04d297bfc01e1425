"""Depth and normal priors on their way into the loss."""

from copy import deepcopy

import numpy as np
import pytest
import torch

from room2dgs.captures.view_maps import ViewMaps
from room2dgs.errors import InputError
from room2dgs.splat.types import Rendering
from room2dgs.train import Hook, load_surfels, train
from room2dgs.train.objective import loss_terms, needed_maps
from room2dgs.train.prior_maps import prior_maps
from room2dgs.train.views import View, Views

START = ["loss.depth_prior.start=0", "loss.normal_prior.start=0", "loss.normal_consistency.enabled=false"]


def wall_prior(tilt=0.0, **changes) -> ViewMaps:
    """The capture's wall, 1.5 m before each camera, as a right prior would have it; or turned by `tilt`."""
    depth = np.full((24, 32), 1.5, np.float32)
    normal = np.zeros((24, 32, 3), np.float32)
    normal[:] = np.sin(tilt), 0, -np.cos(tilt)
    return ViewMaps(depth=depth, normal=normal)._replace(**changes)


def slanted_depth() -> np.ndarray:
    """Depth of a plane: its inverse is linear in the pixel's centre."""
    return np.broadcast_to(1 / (0.4 + 0.01 * (np.arange(32, dtype=np.float32) + 0.5)), (24, 32)).copy()


def view_with(frame, prior: ViewMaps | None = None) -> View:
    return Views([frame], {frame.name: prior} if prior else None).at(0)


def surfel_bits(result):
    return [values.numpy().tobytes() for values in load_surfels(result.surfels_path)]


def test_a_view_has_its_own_frames_maps_and_others_have_none(capture):
    frames = capture[0].train
    views = Views(frames, {frames[1].name: wall_prior()})
    assert views.at(0).maps == ViewMaps()
    maps = views.at(1).maps
    # at every other row and column, rounded as packed maps are
    np.testing.assert_allclose(maps.depth, np.full((12, 16), 1.5), rtol=1e-4)
    np.testing.assert_allclose(maps.normal, wall_prior().normal[::2, ::2], atol=1e-4)
    assert (maps.depth_confidence == 1).all() and (maps.normal_confidence == 1).all()


def test_a_smaller_view_sees_the_same_plane():
    maps = prior_maps(wall_prior(tilt=0.3, depth=slanted_depth()), 16, 12)
    # a small pixel's centre lies between two of the large ones; every other small one is compared
    wanted = 1 / (0.4 + 0.01 * (2 * np.arange(0, 16, 2) + 1))
    np.testing.assert_allclose(maps.depth, np.broadcast_to(wanted, (6, 8)), rtol=1e-6)
    np.testing.assert_allclose(maps.normal[5, 6], [np.sin(0.3), 0, -np.cos(0.3)], atol=1e-6)
    assert (maps.depth_confidence == 1).all() and maps.normal_confidence.shape == (6, 8)


@pytest.mark.parametrize("fraction", [1.0, 0.5])
def test_invalid_pixels_and_depth_edges_are_not_valid_at_any_size(fraction):
    depth = slanted_depth()
    depth[:, 20:] *= 1.5
    normal = wall_prior().normal
    depth[4, 4], normal[8, 8] = 0, 0
    depth[20, 4] = np.nan
    step = int(1 / fraction)
    maps = prior_maps(wall_prior(depth=depth, normal=normal), 32 // step, 24 // step)
    depth_valid, normal_valid = maps.depth_confidence > 0, maps.normal_confidence > 0
    np.testing.assert_array_equal(depth_valid, maps.depth > 0)
    np.testing.assert_array_equal(normal_valid, maps.normal.any(axis=-1))
    step *= 2  # every other pixel is compared
    assert not depth_valid[4 // step, 4 // step] and not depth_valid[20 // step, 4 // step]
    assert not normal_valid[8 // step, 8 // step] and normal_valid.sum() == normal_valid.size - 1
    assert not depth_valid[:, 18 // step : 22 // step].any()
    assert depth_valid[:, 26 // step :].all() and depth_valid[0, : 14 // step].all()
    assert np.isfinite(maps.depth).all()


def test_terms_act_where_their_map_is_and_normals_are_rendered_only_then(capture, configure):
    config = configure(*START)
    frame = capture[0].train[0]
    wants = {
        (True, True): view_with(frame, wall_prior()),
        (True, False): view_with(frame, wall_prior(normal=None)),
        (False, True): view_with(frame, wall_prior(depth=None)),
        (False, False): view_with(frame),
    }
    for (has_depth, has_normal), view in wants.items():
        assert (view.maps.depth is not None, view.maps.normal is not None) == (has_depth, has_normal)
        assert needed_maps(view, config, 0) == {"with_normal": has_normal, "with_distortion": False}
    late = configure(*START, "loss.normal_prior.start=5")
    assert [needed_maps(wants[True, True], late, n)["with_normal"] for n in (4, 5)] == [False, True]


def test_logged_terms_make_up_the_loss(capture, configure, log, tmp_path):
    scene, points = capture
    priors = {frame.name: wall_prior(tilt=0.5) for frame in scene.train}
    weights = ["loss.depth_prior.weight=0.7", "loss.normal_prior.weight=3"]
    losses = train(scene, points, configure(*START, *weights), tmp_path, log, priors).losses
    assert losses["depth_prior"] > 0 and losses["normal_prior"] > 0
    expected = losses["rgb"] + 0.7 * losses["depth_prior"] + 3 * losses["normal_prior"]
    assert losses["loss"] == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize("size", ["1.0", "0.5"])
def test_normals_turn_towards_the_prior(capture, configure, log, tmp_path, size):
    scene, points = capture
    priors = {frame.name: wall_prior(tilt=0.6)._replace(depth=None) for frame in scene.train}
    settings = [
        *START,
        "loss.normal_prior.weight=100",
        f"train.resolutions=[{{fraction: {size}, until: 40}}]",
        "train.coarsest_px=1",
    ]
    settings += ["train.iterations=40", "train.log_every=4", "train.rates.rotation=0.02"]
    train(scene, points, configure(*settings), tmp_path, log, priors)
    values = [float(line.split("normal_prior ")[1].split(")")[0].rstrip(",")) for line in log.lines if ": loss" in line]
    assert values[-1] < 0.5 * values[0]


@pytest.mark.parametrize(
    ("depth", "refit"), [(10 * slanted_depth(), "true"), (np.full((24, 32), 1.45, np.float32), "false")]
)
def test_depth_follows_the_prior(capture, configure, log, tmp_path, depth, refit):
    """Maps in any unit if scale and shift are fitted, else metres; no confidence is given."""
    scene, points = capture
    prior = ViewMaps(depth=depth)
    settings = [
        *START,
        f"loss.depth_refit={refit}",
        "loss.depth_prior.weight=10",
        "train.rates.center=0.02",
        "train.iterations=80",
        "seeds.opacity=0.9",
    ]
    priors = {frame.name: prior for frame in scene.train}
    train(scene, points, configure(*settings), tmp_path, log, priors)
    values = [float(line.split("depth_prior ")[1].split(")")[0]) for line in log.lines if ": loss" in line]
    assert values[-1] < 0.5 * values[0]


def test_without_priors_the_prior_terms_change_no_bit(capture, configure, log, tmp_path):
    scene, points = capture
    off = ["loss.depth_prior.enabled=false", "loss.normal_prior.enabled=false"]
    priors = {frame.name: wall_prior(tilt=0.3) for frame in scene.train}
    plain = surfel_bits(train(scene, points, configure(*off), tmp_path / "off", log))
    assert surfel_bits(train(scene, points, configure(), tmp_path / "none", log)) == plain
    assert surfel_bits(train(scene, points, configure(), tmp_path / "empty", log, {})) == plain
    assert surfel_bits(train(scene, points, configure(*off), tmp_path / "unused", log, priors)) == plain
    elsewhere = {"of another frame": wall_prior()}
    assert surfel_bits(train(scene, points, configure(), tmp_path / "elsewhere", log, elsewhere)) == plain
    assert surfel_bits(train(scene, points, configure(), tmp_path / "used", log, priors)) != plain


def test_resume_wants_the_same_priors(capture, configure, log, tmp_path):
    scene, points = capture
    priors = {frame.name: wall_prior() for frame in scene.train}
    whole = train(scene, points, configure(), tmp_path, log, priors).surfels_path.read_bytes()
    resumed = train(scene, points, configure("resume=true"), tmp_path, log, deepcopy(priors))
    assert resumed.surfels_path.read_bytes() == whole
    first = scene.train[0].name
    depth = priors[first].depth.copy()
    depth[3, 4] += 1e-3
    fewer = {name: prior for name, prior in priors.items() if name != first}
    doubted = {first: priors[first]._replace(depth_confidence=np.full((24, 32), 0.5, np.float32))}
    for other in (None, fewer, priors | {first: priors[first]._replace(depth=depth)}, priors | doubted):
        with pytest.raises(InputError, match="other depth or normal priors"):
            train(scene, points, configure("resume=true"), tmp_path, log, other)
    # a held-out frame's prior is not looked at
    train(scene, points, configure("resume=true"), tmp_path, log, priors | {scene.test[0].name: wall_prior()})


def test_confidences_follow_their_maps_to_any_size():
    confidence = np.tile(np.linspace(0, 1, 32, dtype=np.float32), (24, 1))
    prior = wall_prior(depth_confidence=confidence, normal_confidence=1 - confidence)
    whole, half = (prior_maps(prior, width, 3 * width // 4) for width in (32, 16))
    np.testing.assert_array_equal(whole.depth_confidence, confidence[::2, ::2])
    np.testing.assert_array_equal(whole.normal_confidence, 1 - confidence[::2, ::2])
    smaller = confidence[::2].reshape(12, 16, 2).mean(2)
    np.testing.assert_allclose(half.depth_confidence, smaller[::2, ::2], atol=1e-6)
    np.testing.assert_allclose(half.normal_confidence, 1 - half.depth_confidence, atol=1e-6)


def slanted_rendering(tilt=0.3) -> Rendering:
    normal = torch.zeros(24, 32, 3)
    normal[:] = torch.tensor([np.sin(tilt), 0, -np.cos(tilt)])
    depth, ones = torch.from_numpy(slanted_depth()), torch.ones(24, 32)
    return Rendering(torch.zeros(24, 32, 3), ones, depth, depth, normal, torch.zeros(24, 32))


def test_terms_count_each_pixel_by_its_confidence(capture, configure):
    config, frame = configure(*START), capture[0].train[0]

    def terms(**weights):
        view = view_with(frame, wall_prior(**weights))
        found = loss_terms(slanted_rendering(), torch.zeros(24, 32, 3), view, config, 0)
        return [found[name].value.item() for name in ("depth_prior", "normal_prior")]

    depth, normal = terms()
    confidence = np.full((24, 32), 0.2, np.float32)  # a multiple of 1 / 255
    assert terms(depth_confidence=confidence) == [pytest.approx(depth / 5), normal]
    assert terms(normal_confidence=confidence) == [depth, pytest.approx(normal / 5)]
    # which pixels have none matters: every other row and column is compared
    confidence[::2, ::2] = 0
    assert terms(depth_confidence=confidence, normal_confidence=confidence) == [0, 0]


def test_normals_that_disagree_with_the_rendering_lose_weight_from_its_time_on(capture, configure):
    frame, doubted = capture[0].train[0], ["loss.normal_reweighting={enabled:true,start:0.5,first_deg:60,last_deg:20}"]

    def normal_term(iteration, *settings, tilt=1.0, **weights):
        view = view_with(frame, wall_prior(**weights))
        config = configure(*START, *settings)
        found = loss_terms(slanted_rendering(tilt), torch.zeros(24, 32, 3), view, config, iteration)
        return found["normal_prior"].value.item()

    whole = normal_term(7)
    assert normal_term(3, *doubted) == whole
    first, last = normal_term(4, *doubted), normal_term(7, *doubted)
    # 1 radian is about 60 degrees
    assert first == pytest.approx(whole * (1 + (1 - np.cos(1.0)) / 0.5) ** -2, rel=1e-4)
    assert last == pytest.approx(whole * (1 + (1 - np.cos(1.0)) / (1 - np.cos(np.radians(20)))) ** -2, rel=1e-4)
    assert normal_term(7, *doubted, tilt=0.0) == pytest.approx(normal_term(7, tilt=0.0), abs=1e-7)
    fifth = np.full((24, 32), 0.2, np.float32)
    assert normal_term(7, *doubted, normal_confidence=fifth) == pytest.approx(last / 5)


def test_a_reweighted_run_is_resumed_to_the_same_bits_and_only_at_its_length(capture, configure, log, tmp_path):
    scene, points = capture
    priors = {frame.name: wall_prior(tilt=0.6) for frame in scene.train}
    settings = [*START, "loss.normal_prior.weight=100", "loss.normal_reweighting={enabled:true,start:2}"]
    whole = train(scene, points, configure(*settings), tmp_path / "whole", log, priors).surfels_path.read_bytes()

    class Interrupt(Hook):
        def before_iteration(self, trainer, iteration):
            if iteration.number == 6:
                raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train(scene, points, configure(*settings), tmp_path / "cut", log, priors, [Interrupt()])
    resumed = train(scene, points, configure(*settings, "resume=true"), tmp_path / "cut", log, priors)
    assert resumed.surfels_path.read_bytes() == whole
    without = train(scene, points, configure(*settings[:-1]), tmp_path / "without", log, priors)
    assert without.surfels_path.read_bytes() != whole
    with pytest.raises(InputError, match=r"train\.iterations"):
        train(scene, points, configure(*settings, "resume=true", "train.iterations=12"), tmp_path / "cut", log, priors)
