"""A phone's effects: each does what its name says, alone, and the same seed gives the same photo."""

from __future__ import annotations

import json

import cv2
import numpy as np
import pytest

from room2dgs.captures.image_files import read_photo
from room2dgs.demo_room.atlas import linear_to_srgb
from room2dgs.errors import InputError
from room2dgs.tools.phone_camera.effects import ALL, EFFECTS, OF_PHOTO, chosen, spelled
from room2dgs.tools.phone_camera.phone import random_phone
from room2dgs.tools.phone_camera.photo import phone_photo, phone_photo_of
from room2dgs.tools.phone_camera.wander import wandering_gains
from room2dgs.tools.phone_photos import main, phone_photos

PHONE = random_phone(np.random.default_rng(4))


@pytest.fixture(scope="module")
def light() -> np.ndarray:
    """(120, 160, 3) smooth light with a dark and a bright half, and fine texture in one corner."""
    y, x = np.mgrid[0:120, 0:160].astype(np.float32)
    grey = np.where(x < 80, 0.08, 0.5) + 0.02 * np.sin(y / 19)
    grey[:40, :40] += 0.01 * ((x + y)[:40, :40] % 2)
    return np.stack([grey, 0.9 * grey, 0.8 * grey], axis=-1).astype(np.float32)


def levels(light: np.ndarray, *effects: str) -> np.ndarray:
    return phone_photo(light, 1, PHONE, effects).astype(np.float64)


def test_without_effects_the_levels_are_those_of_srgb(light):
    assert np.array_equal(levels(light), np.round(255 * linear_to_srgb(light)))


def test_the_same_seed_gives_the_same_photo_and_another_one_another(light):
    photo = phone_photo(light, [3, 5])
    assert np.array_equal(photo, phone_photo(light, [3, 5]))
    assert not np.array_equal(photo, phone_photo(light, [3, 6]))
    assert photo.shape == light.shape and photo.dtype == np.uint8
    coded = np.round(255 * linear_to_srgb(light)).astype(np.uint8)
    assert np.array_equal(phone_photo_of(coded, 2), phone_photo_of(coded, 2))


@pytest.mark.parametrize("effect", OF_PHOTO)
def test_each_effect_alone_changes_the_photo(light, effect):
    assert not np.array_equal(levels(light, effect), levels(light))


def test_a_vignette_takes_light_from_the_corners_only():
    flat = levels(np.full((60, 80, 3), 0.4, np.float32), "vignette")
    plain = 255 * linear_to_srgb(np.float32(0.4))
    assert flat[30, 40, 1] == pytest.approx(plain, abs=1)
    lost = 255 * linear_to_srgb(np.float32(0.4 * (1 - PHONE.vignette)))
    assert flat[0, 0, 1] == pytest.approx(lost, abs=1.5)


def test_noise_has_the_deviation_of_read_and_shot_noise():
    flat = levels(np.full((200, 200, 3), 0.4, np.float32), "noise")
    slope = 255 * float(linear_to_srgb(np.float32(0.41)) - linear_to_srgb(np.float32(0.39))) / 0.02
    expected = slope * np.sqrt(PHONE.read**2 + 0.4 * PHONE.shot)
    assert flat.std() == pytest.approx(np.hypot(expected, np.sqrt(1 / 12)), rel=0.05)


def test_local_tone_mapping_brings_dark_and_bright_places_nearer(light):
    def apart(photo: np.ndarray) -> float:
        return photo[60:, 120:].mean() - photo[60:, :40].mean()

    assert 0.3 * apart(levels(light)) < apart(levels(light, "tone")) < 0.95 * apart(levels(light))


def test_smear_takes_fine_texture_and_leaves_the_edge(light):
    def texture(photo: np.ndarray) -> float:
        return float(np.abs(np.diff(photo[5:35, 5:35, 1], axis=1)).mean())

    smeared, plain = levels(light, "smear"), levels(light)
    assert texture(smeared) < 0.6 * texture(plain)
    edge = (plain @ (0.2126, 0.7152, 0.0722))[60, 76:84], (smeared @ (0.2126, 0.7152, 0.0722))[60, 76:84]
    assert np.abs(edge[0] - edge[1]).max() < 3


def test_sharpening_leaves_halos_on_both_sides_of_an_edge(light):
    sharp, plain = levels(light, "sharpening")[60, :, 1], levels(light)[60, :, 1]
    assert sharp[79] < plain[79] - 3 and sharp[80] > plain[80] + 3
    assert abs(sharp[60] - plain[60]) <= 1


def test_effects_are_read_as_they_are_spelled():
    assert chosen("all") == ALL and chosen("none") == frozenset() == chosen("")
    assert chosen("all,-jpeg") == ALL - {"jpeg"}
    assert chosen("blur,wander") == {"blur", "wander"}
    for effects in (ALL, frozenset(), frozenset({"blur", "jpeg"})):
        assert chosen(spelled(effects)) == effects
    with pytest.raises(InputError, match="sepia, which is no effect"):
        chosen("blur,sepia")
    assert set(OF_PHOTO) < set(EFFECTS)


def test_the_wander_is_as_large_as_asked_and_its_mean_is_none():
    gains = wandering_gains(4000, 0.25, np.random.default_rng(0))
    assert np.log(gains).mean(axis=0) == pytest.approx(0, abs=1e-12)
    low, high = np.percentile(gains[:, 1], [5, 95])
    assert low == pytest.approx(1 / 1.25, abs=0.02) and high == pytest.approx(1.25, abs=0.02)
    balance = np.log(gains[:, 0] / gains[:, 1])
    assert 0.15 < balance.std() / np.log(gains[:, 1]).std() < 0.4
    along = np.corrcoef(np.log(gains[:-1, 1]), np.log(gains[1:, 1]))[0, 1]
    assert 0.3 < along < 0.7  # neither constant nor without memory


def test_photos_of_a_capture_wander_by_the_gains_that_are_written(tmp_path):
    capture = tmp_path / "room"
    (capture / "color").mkdir(parents=True)
    (capture / "pose").mkdir()
    grey = np.full((24, 32, 3), 110, np.uint8)
    for index in (0, 1, 10):
        cv2.imwrite(str(capture / f"color/{index}.jpg"), grey)
    out = tmp_path / "wandering"
    phone_photos(capture, out, frozenset({"wander"}), seed=2)
    gains = json.loads((out / "phone.json").read_text())["gains"]
    assert list(gains) == ["0", "1", "10"]
    for name, gain in gains.items():
        found = read_photo(out / f"color/{name}.jpg", None).mean(axis=(0, 1)) / 110
        assert found == pytest.approx(gain, abs=0.03)  # a power of 2.2 is nearly that of sRGB
    assert (out / "pose").is_symlink()


def test_what_photos_alone_cannot_have_is_refused(tmp_path, capsys):
    (tmp_path / "room/color").mkdir(parents=True)
    assert main([str(tmp_path / "room"), str(tmp_path / "out")]) == 2
    assert "no color/*" in capsys.readouterr().err
    cv2.imwrite(str(tmp_path / "room/color/0.jpg"), np.zeros((8, 8, 3), np.uint8))
    assert main([str(tmp_path / "room"), str(tmp_path / "out"), "--phone", "rolling"]) == 2
    assert "make_captures --phone" in capsys.readouterr().err
    assert main([str(tmp_path / "room"), str(tmp_path / "out"), "--wander", "-1"]) == 2
    assert not (tmp_path / "out").exists()
    assert main([str(tmp_path / "room"), str(tmp_path / "out"), "--phone", "all"]) == 0
    assert main([str(tmp_path / "room"), str(tmp_path / "out")]) == 2
