"""The hard cases of `tools/numerics` by one backend: against the float64 reference, and against the CPU's kernels."""

from __future__ import annotations

from typing import Any

import torch

from room2dgs.tools.gpu_check.rendering import renderer
from room2dgs.tools.numerics.compare import compare, differentiate, image_weights, relative_error
from room2dgs.tools.numerics.kinds import kind_of, smooth
from room2dgs.tools.numerics.measure import ALL_SCENES
from room2dgs.tools.numerics.scenes import ILL_CONDITIONED, HardScene

Row = dict[str, Any]


def corpus_row(name: str, backend: str) -> Row:
    """One case: the worst relative error of images and gradients, where the bound lies, and what the CPU differs by."""
    scene = ALL_SCENES[name]()
    render = renderer(backend, kind_of(scene).render)
    found = compare(scene, name in ILL_CONDITIONED, render)
    errors = {**found.images, **found.gradients}
    worst = max(errors, key=lambda key: errors[key] / found.bounds[key])
    again = _same_bits(scene, render)
    return {
        "case": name, "worst": worst, "error": errors[worst], "bound": found.bounds[worst],
        "from_cpu": against_cpu(scene, render), "same_bits_again": again, "finite": found.finite,
        "passed": found.passed and again,
    }  # fmt: skip


def against_cpu(scene: HardScene, render: Any) -> float:
    """The worst relative error of images and gradients from those of the CPU's kernels, away from jumps."""
    kept = smooth(scene)
    weights = [w * (kept[..., None] if w.ndim == 3 else kept) for w in image_weights(scene.width, scene.height)]
    ours, to_ours = differentiate(render, scene, weights, torch.float32)
    theirs, to_theirs = differentiate(kind_of(scene).render, scene, weights, torch.float32)
    images = [relative_error(a[kept], b[kept]) for a, b in zip(ours, theirs, strict=True)]
    return max([*images, *(relative_error(to_ours[name], to_theirs[name]) for name in to_ours)])


def _same_bits(scene: HardScene, render: Any) -> bool:
    """Whether two runs give the same images and gradients, bit for bit."""
    weights = image_weights(scene.width, scene.height)
    (images, gradients), (images_again, again) = (
        differentiate(render, scene, weights, torch.float32) for _ in range(2)
    )  # fmt: skip
    pairs = [*zip(images, images_again, strict=True), *((gradients[name], again[name]) for name in gradients)]
    return all(torch.equal(a, b) for a, b in pairs)
