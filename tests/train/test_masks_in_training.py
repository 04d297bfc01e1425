"""What a mask hides is compared with nothing."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
import torch

from room2dgs.captures.photos import PhotoFile
from room2dgs.splat.types import Rendering
from room2dgs.train import train
from room2dgs.train.grey import grey_photo
from room2dgs.train.objective import loss_terms
from room2dgs.train.terms.image import RGB
from room2dgs.train.views import Views


@pytest.fixture
def masked(capture, tmp_path):
    """The first frame with its left half hidden, and the mask's file."""
    white = np.full((24, 32), 255, np.uint8)
    white[:, :16] = 0
    cv2.imwrite(str(tmp_path / "mask.png"), white)
    return replace(capture[0].train[0], mask_photo=PhotoFile(tmp_path / "mask.png"))


def rendering_of(color: torch.Tensor) -> Rendering:
    zero = torch.zeros(24, 32)
    return Rendering(color, zero + 1, zero + 1, zero + 1, torch.zeros(24, 32, 3), zero)


def test_hidden_pixels_have_no_gradient_and_do_not_change_the_loss(masked, configure):
    view = Views([masked]).at(0)
    config = configure()
    color = torch.rand(24, 32, 3, generator=torch.Generator().manual_seed(0)).requires_grad_()
    values = []
    for image in (view.image, torch.where(view.mask[..., None], view.image, torch.zeros_like(view.image))):
        shown = view._replace(image=image)
        terms = loss_terms(rendering_of(color), shown.target(), shown, config, 0)
        values.append(terms["rgb"].value)
    assert values[0] == values[1]
    (gradient,) = torch.autograd.grad(values[0], color)
    assert (gradient[:, :16] == 0).all() and (gradient[:, 16:] != 0).any()
    whole = loss_terms(rendering_of(color), view.target(), view._replace(mask=None), config, 0)["rgb"].value
    assert whole > values[0]
    assert RGB.weight(config, 0) == 1.0


def test_no_patch_over_a_hidden_pixel_is_compared(masked):
    views = Views([masked])
    textured = grey_photo(views.photo(0), 5, 0.0, views.mask(0)).textured
    assert not textured[:, :18].any() and textured[:, 18:29].any()
    assert views.at(0, 0.5).mask.shape == (12, 16) and not views.mask(0, 0.5)[:, :8].any()


def test_a_run_does_not_see_what_masks_hide(capture, configure, log, tmp_path):
    """The same photos with garbage under their masks give the same surfels."""
    scene, points = capture
    white = np.full((24, 32), 255, np.uint8)
    white[4:14, 4:14] = 0
    cv2.imwrite(str(tmp_path / "mask.png"), white)
    results = []
    for garbage in (0, 255):
        frames = []
        for frame in scene.train:
            photo = cv2.imread(str(frame.color_path))
            photo[4:14, 4:14] = garbage
            path = tmp_path / f"{frame.name}-{garbage}.png"
            cv2.imwrite(str(path), photo)
            frames.append(replace(frame, color_path=path, mask_photo=PhotoFile(tmp_path / "mask.png")))
        config = configure(
            "train.iterations=12",
            *(f"loss.{name}.enabled=true" for name in ("multiview_geometric", "multiview_photometric")),
            *(f"loss.{name}.start=2" for name in ("multiview_geometric", "multiview_photometric")),
            "loss.multiview.patch=5",
            "loss.multiview.min_baseline_m=0.05",
        )
        result = train(replace(scene, train=tuple(frames)), points, config, tmp_path / str(garbage), log)
        results.append(result.losses)
    assert results[0] == results[1] and results[0]["rgb"] > 0
