"""Masks as people write them, photos with alpha, and what is told of masks that hide too much."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from room2dgs.captures.mask_images import MaskImage, MaskRule, facts_of, rule_of
from room2dgs.captures.read import read_scene
from room2dgs.errors import InputError

SHOWN = np.ones((72, 96), bool)
SHOWN[:, :24] = False


def palette(colours: list[int]) -> Image.Image:
    """Labels 0 (hidden) and 1."""
    image = Image.fromarray(SHOWN.astype(np.uint8), "P")
    image.putpalette(colours + [0] * (768 - len(colours)))
    return image


def rgba(alpha: np.ndarray, colour: np.ndarray) -> Image.Image:
    return Image.fromarray(np.dstack([colour, colour, colour, alpha]).astype(np.uint8), "RGBA")


WHITE = np.where(SHOWN, 255, 0).astype(np.uint8)
FULL = np.full_like(WHITE, 255)
KINDS = {
    "grey": lambda: Image.fromarray(WHITE),
    "0 and 1": lambda: Image.fromarray(SHOWN.astype(np.uint8)),
    "0 and 7": lambda: Image.fromarray(7 * SHOWN.astype(np.uint8)),
    "one bit": lambda: Image.fromarray(WHITE).convert("1"),
    "16 bits": lambda: Image.fromarray(257 * WHITE.astype(np.uint16)),
    "16 bits, 0 and 1": lambda: Image.fromarray(SHOWN.astype(np.uint16)),
    "16 bits, 0 and 255": lambda: Image.fromarray(WHITE.astype(np.uint16)),
    "green label": lambda: palette([0, 0, 0, 0, 128, 0]),
    "dark label": lambda: palette([0, 0, 0, 64, 0, 0]),
    "black palette": lambda: palette([0, 0, 0, 0, 0, 0]),
    "palette of black and white": lambda: palette([0, 0, 0, 255, 255, 255]),
    "palette of 0 and 1": lambda: palette([0, 0, 0, 1, 1, 1]),
    "colour": lambda: Image.fromarray(np.dstack([np.zeros_like(WHITE), SHOWN * np.uint8(64), np.zeros_like(WHITE)])),
    "alpha": lambda: rgba(WHITE, FULL),
    "alpha over black": lambda: rgba(WHITE, 0 * FULL),
    "colour with an alpha that says nothing": lambda: rgba(FULL, WHITE),
    "grey with alpha": lambda: Image.merge("LA", [Image.fromarray(FULL), Image.fromarray(WHITE)]),
}


def with_masks(root: Path, masks: list[Image.Image | np.ndarray], suffix: str = ".png") -> None:
    """A mask for each photo of nerfstudio's layout, in the photos' order; None: no mask."""
    known = json.loads((root / "transforms.json").read_text())
    (root / "masks").mkdir()
    for index, frame in enumerate(sorted(known["frames"], key=lambda one: one["file_path"])):
        frame["mask_path"] = f"masks/{index}{suffix}"
        mask = masks[index % len(masks)]
        mask = Image.fromarray(mask) if isinstance(mask, np.ndarray) else mask
        mask.save(root / frame["mask_path"])
    (root / "transforms.json").write_text(json.dumps(known))


@pytest.mark.parametrize("kind", KINDS)
def test_a_mask_of_any_kind_hides_what_it_should(written, settings, kind):
    root = written("nerfstudio")
    with_masks(root, [KINDS[kind]()])
    scene = read_scene(settings(root))
    for frame in scene.frames:
        np.testing.assert_array_equal(frame.mask(), SHOWN)
    assert any("masks hide 25% of the pixels of 6 photos" in note for note in scene.notes)
    assert not scene.warnings


@pytest.mark.parametrize(("white", "black"), [(1, 0), (255, 1), (255, 0)])
def test_what_the_numbers_mean_is_one_rule_for_the_capture(written, settings, white, black):
    """A photo whose mask is dark all over is hidden, and what is 1 beside masks of 255 is dark."""
    root = written("nerfstudio")
    usual = np.where(SHOWN, white, black).astype(np.uint8)
    with_masks(root, [usual, usual, np.full_like(usual, black), usual, usual, usual])
    frames = read_scene(settings(root)).frames
    assert not frames[2].mask().any()
    np.testing.assert_array_equal(frames[0].mask(), SHOWN)


def test_an_alpha_that_hides_a_photo_whole_counts_beside_others_that_do_not(written, settings):
    root = written("nerfstudio")
    with_masks(root, [rgba(WHITE, FULL), rgba(0 * FULL, FULL), rgba(FULL, 0 * FULL)])
    frames = read_scene(settings(root)).frames
    assert [frame.mask().mean() for frame in frames] == [0.75, 0, 1, 0.75, 0, 1]


def alpha_photos(root: Path, alpha: np.ndarray) -> None:
    for path in sorted((root / "images").iterdir()):
        image = cv2.cvtColor(cv2.imread(str(path)), cv2.COLOR_BGR2BGRA)
        image[..., 3] = alpha
        cv2.imwrite(str(path), image)


def test_transparent_pixels_of_photos_are_hidden(written, settings):
    root = written("nerfstudio")
    alpha_photos(root, WHITE)
    scene = read_scene(settings(root))
    np.testing.assert_array_equal(scene.frames[0].mask(), SHOWN)
    assert any("transparent pixels" in note and "25%" in note for note in scene.notes)
    other = np.where(np.arange(72)[:, None] < 36, 0, 255) * np.ones((1, 96), np.uint8)
    with_masks(root, [other.astype(np.uint8)])
    np.testing.assert_array_equal(read_scene(settings(root)).frames[0].mask(), SHOWN & (other > 0))


def test_photos_with_an_alpha_that_hides_nothing_are_as_others(written, settings):
    root = written("nerfstudio")
    before = read_scene(settings(root))
    alpha_photos(root, FULL)
    after = read_scene(settings(root))
    assert after.frames[0].mask() is None and after.notes == before.notes
    np.testing.assert_array_equal(after.frames[0].color(), before.frames[0].color())


def test_photos_that_are_transparent_all_over_stop_the_run(written, settings):
    root = written("nerfstudio")
    alpha_photos(root, 0 * FULL)
    with pytest.raises(InputError, match=r"alpha of the photos.* hide 100%.*without alpha"):
        read_scene(settings(root))


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_masks_that_hide_everything_stop_the_run(written, settings, kind):
    root = written("nerfstudio")
    with_masks(root, [np.zeros((72, 96), kind)])
    with pytest.raises(InputError, match=r"masks hide 100%.*white is what may be used: invert"):
        read_scene(settings(root))


def test_masks_that_hide_nearly_everything_are_a_warning(written, settings):
    root = written("nerfstudio")
    nearly = np.zeros((72, 96), np.uint8)
    nearly[:20, :30] = 255
    with_masks(root, [nearly])
    assert any(
        "hide 91." in line and "white is what may be used" in line for line in read_scene(settings(root)).warnings
    )


def person(inverted: bool) -> np.ndarray:
    """Somebody stands in the middle of the photo."""
    hidden = np.full((72, 96), 255, np.uint8)
    hidden[10:70, 30:65] = 0
    return 255 - hidden if inverted else hidden


@pytest.mark.parametrize("inverted", [False, True])
def test_masks_that_show_only_what_should_be_hidden_are_told(written, settings, inverted):
    root = written("nerfstudio")
    with_masks(root, [person(inverted)])
    said = [line for line in read_scene(settings(root)).warnings if "look inverted" in line]
    assert bool(said) == inverted


@pytest.mark.parametrize("inverted", [False, True])
def test_masks_that_hide_what_several_photos_see_are_told_by_the_points(written, settings, inverted):
    """A floor-to-ceiling curtain at the left of all photos, on which nothing was recognised."""
    root = written("colmap")
    text = (root / "sparse/0/images.txt").read_text().splitlines()
    for row in range(2, len(text), 2):
        values = np.array(text[row].split()).reshape(-1, 3)
        text[row] = " ".join(values[values[:, 0].astype(float) > 40].ravel())
    (root / "sparse/0/images.txt").write_text("\n".join(text) + "\n")
    (root / "sparse/0/points3D.txt").write_text(without_tracks((root / "sparse/0/points3D.txt").read_text(), text))
    curtain = np.full((72, 96), 255, np.uint8)
    curtain[:, :40] = 0
    for photo in sorted((root / "images").rglob("*.jpg")):
        place = root / "masks" / photo.relative_to(root / "images")
        place.parent.mkdir(parents=True, exist_ok=True)
        cv2.imwrite(f"{place}.png", 255 - curtain if inverted else curtain)
    said = [line for line in read_scene(settings(root)).warnings if "look inverted" in line]
    assert bool(said) == inverted and all("points" in line for line in said)


def without_tracks(points: str, images: list[str]) -> str:
    """Points with the observations that the images still have."""
    seen: dict[str, list[str]] = {}
    for row in range(1, len(images), 2):
        number = images[row].split()[0]
        for feature, point in enumerate(images[row + 1].split()[2::3]):
            seen.setdefault(point, []).append(f"{number} {feature}")
    lines = [line.split() for line in points.splitlines() if not line.startswith("#")]
    return "".join(f"{' '.join(line[:8])} {' '.join(seen[line[0]])}\n" for line in lines if line[0] in seen)


def test_a_damaged_mask_costs_its_photo(written, settings):
    root = written("nerfstudio")
    with_masks(root, [WHITE])
    data = (root / "masks/3.png").read_bytes()[:-30]
    (root / "masks/3.png").write_bytes(data)
    scene = read_scene(settings(root))
    assert [one.name for one in scene.dropped] == [f"images_frame_{3 + 8:05d}"]
    assert "masks/3.png" in scene.dropped[0].reason
    (root / "masks/5.png").write_bytes(data)
    with pytest.raises(InputError, match=r"masks/3\.png cannot be decoded.*the first of 2"):
        read_scene(settings(root))


@given(st.integers(0, 2**16 - 1), st.integers(0, 2**16 - 1), st.booleans())
def test_zero_is_hidden_and_the_greatest_number_is_not(one, other, deep):
    kind = np.uint16 if deep else np.uint8
    values = np.array([[0, one, other]], np.uint16).astype(kind)
    rule = rule_of([facts_of(MaskImage(values, None))])
    usable = rule.usable(MaskImage(values, None))
    assert not usable[0, 0] and usable[0].any() == (values.max() > 0)
    assert not rule.by_alpha and rule in (MaskRule(), MaskRule(labels=True))
    assert (np.diff(usable[0][np.argsort(values[0], kind="stable")].astype(int)) >= 0).all()


def test_a_mask_of_labels_without_their_colours_is_damaged(written, settings):
    root = written("nerfstudio")
    with_masks(root, [palette([0, 0, 0, 0, 128, 0])])
    path = root / "masks/2.png"
    data = path.read_bytes()
    start = data.index(b"PLTE") - 4
    path.write_bytes(data[:start] + data[start + 12 + int.from_bytes(data[start : start + 4], "big") :])
    assert "masks/2.png cannot be decoded" in read_scene(settings(root)).dropped[0].reason
