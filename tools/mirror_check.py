"""How well mirrors are found in runs of made rooms, by pixel of the small maps.

    python -m room2dgs.tools.make_captures ROOMS --mirrors 2
    room2dgs run scene.path=ROOMS/room_00 out=RUN prior=room_prior mesh.source=depth
    python -m room2dgs.tools.mirror_check RUN ...

Of each run: the mirrors; precision and recall of the marked pixels; the share of the depths behind a mirror's glass
that are marked; the share of the right depths that are moved by more than 5 %, and of all pixels that are marked.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import cv2
import numpy as np

from room2dgs.captures.image_files import read_photo
from room2dgs.captures.scene import Frame, Scene
from room2dgs.mirrors.find import find_mirrors
from room2dgs.mirrors.mirror import Mirror, behind_glass, shown
from room2dgs.pipeline.mirrors import small_views
from room2dgs.pipeline.scene import scene_of_run
from room2dgs.runs.folder import TRUST, earlier_run
from room2dgs.runs.trust import Trust, read_trust
from room2dgs.tools.command_line import command_line
from room2dgs.tools.make_captures import MIRROR

RIGHT = 0.05  # relative error of a depth that is right


def counted(scene: Scene, trust: dict[str, Trust], mirrors: list[Mirror], masks: Path) -> dict[str, int]:
    """Pixels of all views: marked, of a mirror, both, right, right and moved, behind the glass, these and marked."""
    found: dict[str, int] = {}
    for frame in scene.train:
        one = trust.get(frame.name)
        if one is None or one.depth is None:
            continue
        depth = one.depth.astype(np.float32)
        height, width = depth.shape
        glass = shown(depth, frame.camera.resized(width, height), mirrors)
        marked, moved = glass > 0, np.abs(behind_glass(depth, glass) - depth) > RIGHT * depth
        true = true_depth(frame, (width, height))
        mirror = np.zeros_like(marked)
        path = masks / f"{int(frame.name)}.png" if masks.is_dir() else None
        if path is not None:
            mirror = cv2.resize(read_photo(path, None)[..., 0], (width, height), interpolation=cv2.INTER_NEAREST) > 0
        right = (true > 0) & (np.abs(depth - true) < RIGHT * true)
        behind = mirror & (true > 0) & (depth > (1 + RIGHT) * true)
        kinds = {
            "pixels": np.ones_like(marked),
            "marked": marked,
            "mirror": mirror,
            "both": marked & mirror,
            "right": right,
            "right, moved": right & moved,
            "behind": behind,
            "behind, marked": behind & marked,
        }
        for name, which in kinds.items():
            found[name] = found.get(name, 0) + int(which.sum())
    return found


def true_depth(frame: Frame, size: tuple[int, int]) -> np.ndarray:
    """(h, w) the capture's depth, 0 = unknown."""
    depth = frame.depth()
    if depth is None:
        return np.zeros(size[::-1], np.float32)
    return cv2.resize(depth.astype(np.float32), size, interpolation=cv2.INTER_NEAREST)


def line(name: str, mirrors: list[Mirror], count: dict[str, int]) -> str:
    """A run's figures."""

    def share(part: str, whole: str) -> str:
        return f"{count[part] / count[whole]:.4f}" if count.get(whole) else "-"

    sizes = ", ".join(f"{width:.1f} x {height:.1f} m" for width, height in (one.size_m for one in mirrors))
    return (
        f"{name}: {len(mirrors)} mirrors ({sizes}): precision {share('both', 'marked')}, "
        f"recall {share('both', 'mirror')}, of depths behind the glass {share('behind, marked', 'behind')}; "
        f"of right depths {share('right, moved', 'right')} are moved, of all {share('marked', 'pixels')} marked"
    )


@command_line("mirror_check")
def main(arguments: list[str]) -> None:
    """The command line."""
    parser = argparse.ArgumentParser(prog="mirror_check", description="How well mirrors are found in runs.")
    parser.add_argument("runs", type=Path, nargs="+", metavar="RUN", help="run of a capture")
    for run in parser.parse_args(arguments).runs:
        config = earlier_run([f"out={run}"])
        scene, trust = scene_of_run(config), read_trust(run / TRUST)
        mirrors = find_mirrors(small_views(scene, trust))
        masks = Path(config.scene.path) / MIRROR
        print(line(run.name, mirrors, counted(scene, trust, mirrors, masks)), flush=True)


if __name__ == "__main__":
    sys.exit(main())
