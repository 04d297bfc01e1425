"""Depth maps and masks have the shape of their photos, in every layout."""

from __future__ import annotations

import json
from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from room2dgs.captures.read import read_scene
from room2dgs.captures.shapes import same_shape
from room2dgs.errors import InputError
from room2dgs.tools.capture_layouts.registry import LAYOUTS

# The others have a depth camera of their own, or tell the size of the maps beside them.
REGISTERED = [
    name
    for name, layout in LAYOUTS.items()
    if layout.depth and not name.startswith("ros") and name not in ("sens", "record3d_archive")
]


@pytest.fixture
def read(written, settings, made):
    """`read(layout, depths)` reads the made scene with other depth maps."""

    def reading(name: str, depths: np.ndarray):
        root = written(name, made=replace(made, depths=depths))
        for path in root.rglob("intrinsic_depth.txt"):
            path.unlink()
        return read_scene(settings(root, **LAYOUTS[name].settings(made)))

    return reading


@pytest.mark.parametrize("name", REGISTERED)
def test_depth_maps_on_their_side_are_named_as_such(read, made, name):
    turned = np.ascontiguousarray(np.rot90(made.depths, axes=(1, 2)))
    with pytest.raises(InputError, match=r"lies on its side: 72x96 .* photo of 96x72; turn the depth maps"):
        read(name, turned)


@pytest.mark.parametrize("name", REGISTERED)
def test_cropped_depth_maps_are_refused(read, made, name):
    with pytest.raises(InputError, match=r"has 96x54 pixels, another shape than its photo of 96x72; register depth"):
        read(name, made.depths[:, 9:63])


@pytest.mark.parametrize("name", REGISTERED)
def test_smaller_depth_maps_are_resized(read, made, name):
    depth = read(name, np.ascontiguousarray(made.depths[:, 8::2, 8::2][:, :30, :40])).frames[0].depth()
    assert depth.shape == (72, 96) and (depth > 0).mean() > 0.9


def masked(root, size: tuple[int, int]) -> None:
    """A mask for each photo of nerfstudio's layout."""
    known = json.loads((root / "transforms.json").read_text())
    (root / "masks").mkdir()
    for index, frame in enumerate(known["frames"]):
        frame["mask_path"] = f"masks/{index}.png"
        cv2.imwrite(str(root / frame["mask_path"]), np.full(size[::-1], 255, np.uint8))
    (root / "transforms.json").write_text(json.dumps(known))


@pytest.mark.parametrize(
    ("size", "said"),
    [((72, 96), "lies on its side: 72x96 .* turn the masks"), ((96, 96), "has 96x96 pixels, another shape")],
)
def test_masks_of_another_shape_are_refused(written, settings, size, said):
    root = written("nerfstudio")
    masked(root, size)
    with pytest.raises(InputError, match=said):
        read_scene(settings(root))


def test_masks_of_half_the_size_are_resized(written, settings):
    root = written("nerfstudio")
    masked(root, (48, 36))
    assert read_scene(settings(root)).frames[0].mask().all()


@settings(max_examples=400)
@given(st.integers(16, 6000), st.integers(16, 6000), st.floats(0.02, 1.0))
def test_a_picture_made_smaller_has_its_shape_and_turned_ones_have_not(width, height, factor):
    small = max(1, round(width * factor)), max(1, round(height * factor))
    if min(small) < 8:
        return
    assert same_shape(small, (width, height))
    if min(small) > 20 and max(width / height, height / width) > 1.2:
        assert not same_shape(small[::-1], (width, height))
