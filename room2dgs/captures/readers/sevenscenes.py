"""Microsoft's 7-Scenes: seq-01/frame-000000.{color.png,depth.png,pose.txt}.

Poses are camera-to-world, metres, OpenCV axes. Depth is in millimetres, 65535 = none, of a camera of its own (585, 585,
320, 240) that is not registered to the photos. No file has the intrinsics; 525 px fit the colour camera.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path

from room2dgs.captures.capture import Capture, Shot, lost, pinhole_lens
from room2dgs.captures.depth_maps import depth_file
from room2dgs.captures.listing import Listing, gt_mesh_in, listed, natural
from room2dgs.captures.matrix_files import read_world_from_cam
from room2dgs.captures.reader import Reader
from room2dgs.captures.text_files import lines_of
from room2dgs.config import SceneConfig
from room2dgs.errors import InputError

LAYOUT = "seq-01/frame-000000.color.png and .pose.txt (7-Scenes)"
SIZE = (640, 480)
COLOR = (525.0, 525.0, 320.0, 240.0)
DEPTH_K = ((585.0, 0.0, 320.0), (0.0, 585.0, 240.0), (0.0, 0.0, 1.0))
NO_DEPTH = 65535


def is_sevenscenes(files: Listing) -> bool:
    if "_info.txt" in files:
        return False  # ScanNet's own exporter names photos alike
    return bool(files.matching("frame-*.color.png")) or any(
        name.startswith("frame-") and name.endswith(".color.png")
        for sequence in files.matching("seq-*")[:1]
        for name in listed(files.root / sequence)
    )


def read_sevenscenes(root: Path, config: SceneConfig) -> Capture:
    """Read one sequence, or a scene with all of its sequences and their split.

    Raises:
        InputError: see `room2dgs.captures.read.read_scene`.
    """
    lens = pinhole_lens(*COLOR, SIZE, f"{root} (the usual camera of 7-Scenes)", True)
    folders = [root / name for name in Listing(root).matching("seq-*")] or [root]
    shots = []
    for folder in folders:
        names = listed(folder)
        prefix = "" if folder == root else f"{folder.name}_"
        for name in natural(name for name in names if name.endswith(".color.png")):
            stem = name.removesuffix(".color.png")
            depth, pose = folder / f"{stem}.depth.png", f"{stem}.pose.txt"
            sensor = depth_file(depth, K=DEPTH_K, K_size=SIZE, invalid=NO_DEPTH)
            shots.append(
                Shot(
                    f"{prefix}{stem}",
                    folder / name,
                    partial(read_world_from_cam, folder / pose) if pose in names else lost(f"{pose} is missing"),
                    lens,
                    depth=sensor if depth.name in names else None,
                )
            )
    if not shots:
        raise InputError(f"{root} has no photos; a scene of 7-Scenes has {LAYOUT}")
    notes = [f"intrinsics: none in the layout, {COLOR} taken; scene.intrinsics=[fx,fy,cx,cy] gives others"]
    if config.intrinsics is not None:
        notes = []
    test, test_notes = _test(root, [shot.name for shot in shots])
    notes += test_notes
    return Capture(
        root, "sevenscenes", shots, test=test, gt_mesh=gt_mesh_in(root), notes=notes, why="KinectFusion's poses"
    )


def _test(root: Path, names: list[str]) -> tuple[frozenset[str] | None, list[str]]:
    """Names of the frames of the test sequences, and a note where these are none or all that there are."""
    path = root / "TestSplit.txt"
    if not path.is_file():
        return None, []
    numbers = ["".join(letter for letter in text if letter.isdigit()) for _, text in lines_of(path)]
    sequences = tuple(f"seq-{int(text):02d}_" for text in numbers if 0 < len(text) < 6)
    found = frozenset(name for name in names if name.startswith(sequences)) if sequences else frozenset()
    if found and len(found) < len(names):
        return found, []
    share = "all" if found else "none"
    return None, [f"{path} holds out {share} of the sequences that are there, so that it is not used"]


READER = Reader(is_sevenscenes, read_sevenscenes, LAYOUT)
