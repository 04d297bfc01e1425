"""How good the maps are on held-out rooms."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from room2dgs.tools.prior_network.angular import expected_angle
from room2dgs.tools.prior_network.batches import Batch, moved, validation_batch
from room2dgs.tools.prior_network.losses import median_offset
from room2dgs.tools.prior_network.network import Maps, PriorNetwork
from room2dgs.tools.prior_network.shards import Shards

CONFIDENT_SHARE = 0.5


class Validation(NamedTuple):
    """Attributes: scores by name; pictures (H, W, 3) uint8 by name."""

    scores: dict[str, float]
    pictures: dict[str, np.ndarray]


def validate(
    network: PriorNetwork, shards: Shards, size: tuple[int, int], samples: int, batch: int, seed: int, pictures: int = 4
) -> Validation:
    """Scores of the network on samples spread over the shards.

    Returns:
        Means over pixels of each photo, then over photos. abs_rel after the photo's scale (median) is set right and
        metric_abs_rel before; angles in degrees; *_confident: the same over the half of each photo's pixels that
        the network trusts most; *_expected: what the network expects abs_rel and normal_mean to be.
    """
    chosen = np.unique(np.linspace(0, len(shards) - 1, min(samples, len(shards))).astype(int)).tolist()
    rows: list[dict[str, float]] = []
    drawn: dict[str, np.ndarray] = {}
    for start in range(0, len(chosen), batch):
        made = validation_batch(shards, size, chosen[start : start + batch], seed)
        with torch.inference_mode():
            there = moved(made, next(network.parameters()).device)
            maps = Maps(*(part.cpu() for part in network(there.image, there.intrinsics)))
        for index in range(len(made.image)):
            rows.append(photo_scores(maps, made, index))
            if len(drawn) < pictures:
                drawn[f"validation/{len(drawn)}"] = picture(maps, made, index)
    with np.errstate(all="ignore"):
        return Validation({name: float(np.nanmean([row[name] for row in rows])) for name in rows[0]}, drawn)


def photo_scores(maps: Maps, batch: Batch, index: int) -> dict[str, float]:
    """Scores of one photo; nan where it has no truth."""
    one = slice(index, index + 1)
    valid = batch.truth.depth[one] > 0
    error = maps.ln_depth[one] - torch.where(valid, batch.truth.depth[one], 1.0).log()
    aligned = error - median_offset(error, valid)
    faced = batch.truth.normal[one].square().sum(dim=1, keepdim=True) > 0.5
    cosine = (maps.normal[one] * batch.truth.normal[one]).sum(dim=1, keepdim=True).clamp(-1.0, 1.0)
    angle, expected = torch.rad2deg(torch.acos(cosine)), expected_angle(maps.ln_kappa[one].exp())
    relative, scale = (aligned.exp() - 1.0).abs(), maps.ln_scale[one].exp()
    return {
        "abs_rel": _mean(relative, valid),
        "abs_rel_confident": _mean(relative, _most_confident(scale, valid)),
        "abs_rel_expected": _mean(scale, valid),
        "delta1": _mean((aligned.abs() < np.log(1.25)).float(), valid),
        "metric_abs_rel": _mean((error.exp() - 1.0).abs(), valid),
        "normal_mean": _mean(angle, faced),
        "normal_median": float(angle[faced].median()) if faced.any() else float("nan"),
        "normal_11": _mean((angle < 11.25).float(), faced),
        "normal_mean_confident": _mean(angle, _most_confident(expected, faced)),
        "normal_expected": float(np.degrees(_mean(expected, faced))),
    }


def picture(maps: Maps, batch: Batch, index: int) -> np.ndarray:
    """Photo, true and predicted normals, true and predicted depth, expected angle, side by side."""
    height, width = maps.ln_depth.shape[-2:]
    image = batch.image[index].permute(1, 2, 0).reshape(height, 2, width, 2, 3).mean(dim=(1, 3))
    true_depth = batch.truth.depth[index, 0]
    valid = true_depth > 0
    logs = torch.where(valid, true_depth, 1.0).log()
    low, high = (logs[valid].min(), logs[valid].max()) if valid.any() else (logs.min(), logs.max())
    offset = median_offset(maps.ln_depth[index : index + 1] - logs, valid[None, None])[0, 0]

    def shade(values: Tensor) -> Tensor:
        return ((values - low) / (high - low + 1e-6)).clamp(0.0, 1.0)[..., None].expand(-1, -1, 3)

    def colour(normal: Tensor) -> Tensor:
        return (normal.permute(1, 2, 0) + 1.0) / 2.0

    expected = (expected_angle(maps.ln_kappa[index, 0].exp()) / np.radians(60.0)).clamp(0.0, 1.0)
    tiles = [
        image,
        colour(batch.truth.normal[index]),
        colour(maps.normal[index]),
        shade(logs) * valid[..., None],
        shade(maps.ln_depth[index, 0] - offset),
        expected[..., None].expand(-1, -1, 3),
    ]
    return np.round(255.0 * torch.cat(tiles, dim=1).numpy()).astype(np.uint8)


def _mean(values: Tensor, mask: Tensor) -> float:
    return float(values[mask].mean()) if mask.any() else float("nan")


def _most_confident(expected: Tensor, mask: Tensor) -> Tensor:
    """The share of the mask's pixels with the least expected error."""
    if not mask.any():
        return mask
    count = max(1, round(CONFIDENT_SHARE * int(mask.sum())))
    order = torch.argsort(torch.where(mask, expected, torch.inf).flatten(), stable=True)
    chosen = torch.zeros_like(mask.flatten())
    chosen[order[:count]] = True
    return chosen.reshape(mask.shape)
