"""One corner of a room in six small photos, and runs of it."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
import trimesh

from room2dgs import cli

PHOTOS, WIDTH, HEIGHT = 6, 80, 60
FOCAL = 65.0
QUICK = [
    "points.source=file",
    "seeds.voxel_m=0.1",
    "train.iterations=30",
    "train.rates.color=0.05",
    "train.checkpoint_every=15",
    "train.tensorboard=false",
    "mesh.voxel_m=0.06",
    "mesh.min_triangles=1",
    "mesh.max_error_m=null",
    "eval.samples=2000",
    "scene.test_every=3",
    "report.views=2",
    "report.max_surfels=300",
    "prior=none",
]


@pytest.fixture(scope="package")
def room(corner_views, tmp_path_factory) -> Path:
    """ScanNet's layout, with points and the true mesh: the planes x = 0, y = 0 and z = 0."""
    folder = tmp_path_factory.mktemp("stories") / "room"
    for name in ("color", "pose", "intrinsic"):
        (folder / name).mkdir(parents=True)
    K = np.eye(4)
    K[0, 0] = K[1, 1] = FOCAL
    K[:2, 2] = (WIDTH - 1) / 2, (HEIGHT - 1) / 2
    np.savetxt(folder / "intrinsic/intrinsic_color.txt", K)
    found = []
    for number, (pose, photo, depth) in enumerate(corner_views[:PHOTOS]):
        small = cv2.resize(photo, (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA)
        cv2.imwrite(str(folder / f"color/{number}.png"), small)
        np.savetxt(folder / f"pose/{number}.txt", pose)
        v, u = np.mgrid[2 : depth.shape[0] : 12, 2 : depth.shape[1] : 12]
        z = depth[v, u] / 1000.0
        rays = np.stack([(u - 159.5) / 260.0, (v - 119.5) / 260.0, np.ones_like(z)], axis=-1)
        xyz = (rays * z[..., None]).reshape(-1, 3) @ pose[:3, :3].T + pose[:3, 3]
        found.append(np.column_stack([xyz, photo[v, u, ::-1].reshape(-1, 3)]))
    found = np.concatenate(found)
    trimesh.PointCloud(found[:, :3], colors=found[:, 3:].astype(np.uint8)).export(folder / "points.ply")
    steps = np.arange(0, 3.01, 0.1)
    u, v = (part.ravel() for part in np.meshgrid(steps, steps, indexing="ij"))
    n = len(steps)
    corner = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    faces = np.concatenate([[corner, corner + n, corner + 1], [corner + 1, corner + n, corner + n + 1]], axis=1).T
    sides = []
    for axis in range(3):
        xyz = np.zeros((len(u), 3))
        xyz[:, (axis + 1) % 3], xyz[:, (axis + 2) % 3] = u, v
        sides.append(trimesh.Trimesh(xyz, faces, process=False))
    trimesh.util.concatenate(sides).export(folder / "gt_mesh.ply")
    return folder


@pytest.fixture(scope="package")
def trained(room, tmp_path_factory) -> Path:
    """A finished run; not to be written to (`copied`)."""
    out = tmp_path_factory.mktemp("stories") / "trained"
    told(*settings(room, out))
    return out


@pytest.fixture(scope="package")
def untrained(room, tmp_path_factory) -> Path:
    """A finished run of the points' surface alone; not to be written to."""
    out = tmp_path_factory.mktemp("stories") / "untrained"
    told(*settings(room, out), "mesh.source=points")
    return out


@pytest.fixture
def copied(tmp_path):
    """`copied(run)` gives a copy that may be written to."""
    return lambda run, name="copy": Path(shutil.copytree(run, tmp_path / name))


def settings(room: Path, out: Path) -> list[str]:
    return ["run", f"scene.path={room}", f"out={out}", f"points.file={room / 'points.ply'}", *QUICK]


def told(*argv: str) -> None:
    """Runs a command that must succeed."""
    assert cli.main(list(argv)) == 0, argv


@pytest.fixture
def refused(capsys):
    """Runs a command that must be refused; gives its one sentence."""

    def refuse(*argv: str) -> str:
        capsys.readouterr()
        assert cli.main(list(argv)) == 2, argv
        said = capsys.readouterr().err
        assert said.startswith("room2dgs: ") and said.count("\n") == 1, said
        return said

    return refuse


@pytest.fixture(scope="package")
def story():
    """The helpers above, for test modules (which cannot import a conftest)."""

    def metrics(out: Path) -> dict:
        return json.loads((out / "metrics.json").read_text())

    def files(folder: Path) -> dict[str, bytes]:
        return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}

    return SimpleNamespace(settings=settings, told=told, metrics=metrics, files=files, cli=cli.main)
