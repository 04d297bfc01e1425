"""A made capture that does not tell its unit, and runs of it, for the tests of units."""

from __future__ import annotations

import json

import cv2
import numpy as np
import trimesh

from room2dgs import cli

WALL_Z = 2.0


def capture_of(wall, folder, factor):
    """The wall as nerfstudio has it, which does not tell its unit; its points and a prior's depth in metres."""
    (folder / "images").mkdir(parents=True)
    (folder / "maps").mkdir()
    frames = []
    for path in sorted((wall / "pose").iterdir()):
        pose = np.loadtxt(path) @ np.diag([1.0, -1.0, -1.0, 1.0])
        pose[:3, 3] *= factor
        photo = cv2.imread(str(wall / f"color/{path.stem}.png"))
        cv2.imwrite(str(folder / f"images/{path.stem}.png"), photo)
        np.save(folder / f"maps/{path.stem}.npy", np.full(photo.shape[:2], WALL_Z, np.float32))
        frames.append({"file_path": f"images/{path.stem}.png", "transform_matrix": pose.tolist()})
    meta = {"w": 64, "h": 48, "fl_x": 50.0, "fl_y": 50.0, "cx": 32.0, "cy": 24.0, "frames": frames}
    (folder / "transforms.json").write_text(json.dumps(meta))
    cloud = trimesh.load(wall / "points.ply")
    trimesh.PointCloud(np.asarray(cloud.vertices) * factor, colors=cloud.colors).export(folder / "points.ply")
    return folder


def overrides(capture, out, *more: str) -> list[str]:
    """Settings of a run that reads points and depth from files."""
    given = [f"scene.path={capture}", f"out={out}", "points.source=file", f"points.file={capture / 'points.ply'}"]
    given += ["sfm.refine_poses=false", "prior=files", f"prior.depth.path={capture / 'maps'}", "stereo.enabled=false"]
    given += ["prior.normal.source=none", "prior.depth.joint=false", "mesh.source=depth", "mesh.min_triangles=10"]
    return [*given, "report.enabled=false", "eval.samples=500", *more]


def run(capture, out, *more: str) -> int:
    """The exit code of a run with these settings."""
    return cli.main(["run", *overrides(capture, out, *more)])
