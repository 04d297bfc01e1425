"""Scores of meshes and images against a ground truth, by named protocols. A library of its own.

    from room2dgs.eval import evaluate

    result = evaluate("mesh.ply", "gt_mesh.ply", cameras, protocols=("area", "neuris"))
    result.scores.as_dict()["f_score_5cm"]

It needs geometry, mesh files and the TSDF fusion (protocol `manhattan`) of this package, and nothing of training.
Names are imported when they are first used: open3d takes a second.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from room2dgs.eval.image_metrics import image_scores, psnr, ssim
    from room2dgs.eval.pictures import write_pictures
    from room2dgs.eval.protocol import MeshFile, Options, Result
    from room2dgs.eval.scoring import PROTOCOLS, Evaluation, evaluate

_HOMES = {
    **dict.fromkeys(("PROTOCOLS", "Evaluation", "evaluate"), "scoring"),
    **dict.fromkeys(("MeshFile", "Options", "Result"), "protocol"),
    **dict.fromkeys(("image_scores", "psnr", "ssim"), "image_metrics"),
    "write_pictures": "pictures",
}
__all__ = [
    "PROTOCOLS",
    "Evaluation",
    "MeshFile",
    "Options",
    "Result",
    "evaluate",
    "image_scores",
    "psnr",
    "ssim",
    "write_pictures",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
