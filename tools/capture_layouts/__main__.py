"""Writes some frames of a real capture in every layout and says whether each gives the same cameras, pictures and mesh.

    python -m room2dgs.tools.capture_layouts CAPTURE OUT [KEY=VALUE ...] --frames 20

A mesh is made of the photos alone (`run mesh.source=depth prior=room_prior`, nothing is trained, no stereo) and scored
against CAPTURE's gt_mesh.ply. Where cameras and pictures are those of another layout bit by bit, its run counts, unless
--every is given. JPEG files keep their bytes and PNG files hold just what those decode to, so that all layouts but
videos show the same pixels. The table comes as Markdown; OUT/runs keeps the runs, and the same call goes on after the
last of them.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import shutil
import subprocess
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from room2dgs.captures.read import read_scene
from room2dgs.captures.scene import Scene
from room2dgs.config import load_config
from room2dgs.errors import InputError
from room2dgs.files import whole_file
from room2dgs.tools.capture_layouts.made import Made
from room2dgs.tools.capture_layouts.real import made_of
from room2dgs.tools.capture_layouts.registry import LAYOUTS, Layout
from room2dgs.tools.command_line import command_line

# the whole capture is used, and every layout sees the same points
RUN = [
    "mesh.source=depth", "prior=room_prior", "points.source=file", "sfm.refine_poses=false", "stereo.enabled=false",
    "report.enabled=false", "export.after_run=[]", "eval.image_metrics=false",
]  # fmt: skip
MESH = "mesh", "f_score_5cm", "faces"
ALL = {"test_every": 0, "split": "every"}


@dataclass(frozen=True)
class Differences:
    """How far a scene as it was read is from what was written; largest differences, None: the layout has none of it.

    Attributes:
        pose: of the poses' numbers; K: pixels.
        levels: of the photos' colours; depth_m, points_m: metres.
        digest: of all cameras and pictures: what is equal here is equal for a run.
    """

    pose: float
    K: float
    levels: int
    depth_m: float | None
    points_m: float | None
    digest: str


def differences(scene: Scene, made: Made, layout: Layout) -> Differences:
    """A scene of all photos at their own size against what was written.

    Raises:
        InputError: another number of photos, or other depth or points than the layout holds.
    """
    if len(scene.frames) != made.count or scene.dropped:
        raise InputError(f"{scene.path} gives {len(scene.frames)} of {made.count} photos")
    if (scene.given_points is not None) != layout.points or (scene.frames[0].depth() is not None) != layout.depth:
        raise InputError(f"{scene.path} gives other depth or points than were written")
    digest, pose, K, levels, depth = hashlib.sha256(), 0.0, 0.0, 0, 0.0
    for index, frame in enumerate(scene.frames):
        camera, color = frame.camera, frame.color()
        for array in (camera.cam_from_world + 0.0, camera.K, color):
            digest.update(np.ascontiguousarray(array).tobytes())
        pose = max(pose, np.abs(camera.world_from_cam - made.poses[index]).max())
        K = max(K, np.abs(camera.K - made.K).max())
        levels = max(levels, int(np.abs(color[..., ::-1].astype(int) - made.photos[index]).max()))
        if layout.depth:
            depth = max(depth, float(np.abs(frame.depth() - made.depths[index] / 1000).max()))
    points = None
    if layout.points:
        seen = np.unique(np.concatenate([index for index, _ in made.seen]))
        assert scene.given_points is not None
        points = float(np.abs(scene.given_points().xyz - made.xyz[seen]).max())
    return Differences(float(pose), float(K), levels, depth if layout.depth else None, points, digest.hexdigest())


def compared(
    name: str, made: Made, out: Path, gt_mesh: Path | None, settings: list[str], known: list[dict[str, object]]
) -> dict[str, object]:
    """A row of the table; the layout's files are there only while it is made.

    Args:
        known: rows whose mesh is taken where the input is theirs, bit by bit.

    Raises:
        InputError: as `differences`, or a run that fails.
    """
    layout, folder, run = LAYOUTS[name], out / "captures" / name, out / "runs" / name
    shutil.rmtree(folder.parent, ignore_errors=True)
    layout.write(folder, made)
    of_scene: dict[str, Any] = {**ALL, **layout.settings(made)}
    config = replace(load_config([f"scene.path={folder}", "out=unused"]).scene, **of_scene)
    found = differences(read_scene(config), made, layout)
    row: dict[str, object] = {"layout": name, **vars(found)}
    same = next((before for before in known if before["digest"] == found.digest and "mesh" in before), None)
    if gt_mesh is not None and same is not None:
        row |= {key: same[key] for key in MESH} | {"run_of": same.get("run_of", same["layout"])}
    elif gt_mesh is not None:
        given = [f"scene.{key}={json.dumps(value)}".replace(" ", "") for key, value in of_scene.items()]
        given = [f"scene.path={folder}", f"out={run}", f"scene.gt_mesh={gt_mesh}", *given, *RUN]
        row |= mesh_of([*given, f"points.file={out / 'points.ply'}", *settings], run)
    shutil.rmtree(folder.parent)
    return row


def mesh_of(arguments: list[str], run: Path) -> dict[str, object]:
    """The mesh's digest and score, by `room2dgs run` in a process of its own.

    Raises:
        InputError: it fails.
    """
    shutil.rmtree(run, ignore_errors=True)
    done = subprocess.run(
        [sys.executable, "-m", "room2dgs.cli", "run", *arguments], capture_output=True, text=True, check=False
    )
    if done.returncode:
        raise InputError(f"{run} failed: {done.stderr.strip().splitlines()[-1:]}")
    metrics = json.loads((run / "metrics.json").read_text(encoding="utf-8"))
    mesh = hashlib.sha256((run / "mesh.ply").read_bytes()).hexdigest()
    return dict(zip(MESH, (mesh, metrics["f_score_5cm"], metrics["mesh_faces"]), strict=True))


def table(rows: list[dict[str, object]]) -> str:
    """Markdown; meshes and inputs of the same bits have the same letter."""
    letters: dict[tuple[str, object], str] = {}

    def letter(kind: str, value: object) -> str:
        if value is None:
            return "—"
        return letters.setdefault((kind, value), f"{sum(key[0] == kind for key in letters) + 1}")

    def number(value: object) -> str:
        return "—" if value is None else "0" if value == 0 else f"{value:.0e}"

    lines = [
        "| layout | poses | K, px | depth, m | points, m | pixels, levels | input | mesh | F@5cm |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        score = row.get("f_score_5cm")
        cells = [row["layout"], *(number(row[key]) for key in ("pose", "K", "depth_m", "points_m")), row["levels"]]
        cells += [letter("input", row["digest"]), letter("mesh", row.get("mesh"))]
        cells += ["—" if score is None else f"{score:.4f}" + (f" ({row['run_of']})" if "run_of" in row else "")]
        lines.append(f"| {' | '.join(map(str, cells))} |")
    return "\n".join(lines)


@command_line("capture_layouts")
def main(arguments: list[str]) -> None:
    """The command line."""
    parser = argparse.ArgumentParser(
        prog="capture_layouts",
        description="Write a capture in every layout and compare what is read and meshed.",
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    parser.add_argument("capture", type=Path, help="a capture with depth, one camera and no distortion")
    parser.add_argument("out", type=Path, help="folder to write")
    parser.add_argument("--first", type=int, default=0, help="the first frame")
    parser.add_argument("--frames", type=int, default=20, help="how many")
    parser.add_argument("--step", type=int, default=1, help="every which")
    parser.add_argument("--layouts", nargs="*", choices=LAYOUTS, default=list(LAYOUTS), metavar="NAME")
    parser.add_argument("--no-mesh", action="store_true", help="cameras and pictures alone")
    parser.add_argument("--every", action="store_true", help="a run also for layouts that give another one's bits")
    parser.add_argument("settings", nargs="*", default=["scene.image_width=320"], help="of the runs")
    given = parser.parse_args(arguments)
    gt_mesh = given.capture / "gt_mesh.ply"
    if not given.no_mesh and not gt_mesh.is_file():
        raise InputError(f"{gt_mesh} is missing; add --no-mesh")
    made = made_of(given.capture, given.first, given.frames, given.step)
    given.out.mkdir(parents=True, exist_ok=True)
    trimesh.PointCloud(made.xyz, colors=made.rgb).export(given.out / "points.ply")
    rows: list[dict[str, object]] = []
    for name in given.layouts:
        rows.append(kept(name, made, given, None if given.no_mesh else gt_mesh, [] if given.every else rows))
        print(table(rows[-1:]).splitlines()[-1], flush=True)
    print(f"\n{table(rows)}")


def kept(
    name: str, made: Made, given: argparse.Namespace, gt_mesh: Path | None, known: list[dict[str, object]]
) -> dict[str, object]:
    """The row of an earlier call that was about the same, or a new one."""
    path = given.out / "rows" / f"{name}.json"
    asked = [str(given.capture), given.first, given.frames, given.step, bool(gt_mesh), given.settings]
    try:
        before = json.loads(path.read_text(encoding="utf-8"))
        if before["asked"] == asked:
            return before["row"]
    except (OSError, ValueError, KeyError, TypeError):
        pass
    row = compared(name, made, given.out, gt_mesh, given.settings, known)
    with whole_file(path) as temporary:
        temporary.write_text(json.dumps({"asked": asked, "row": row}), encoding="utf-8")
    return row


if __name__ == "__main__":
    sys.exit(main())
