"""Whether a run that was killed after its mesh has that mesh already."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict
from pathlib import Path

from room2dgs import __version__
from room2dgs.blame import by_the_machine
from room2dgs.captures.scene import Scene
from room2dgs.config import Config
from room2dgs.files import whole_file
from room2dgs.runs.folder import KEPT, MESH, SURFELS, TRUST

FORMAT = 1
MARK = "mesh.json"
CHUNK = 1 << 20


def mesh_key(scene: Scene, config: Config, out: Path) -> str:
    """Stands for all that the mesh of a run's surfels is made of."""
    sections = [FORMAT, __version__, *(asdict(part) for part in (config.mesh, config.render, config.prior.depth))]
    digest = hashlib.sha256(repr(sections).encode())
    for frame in scene.train:
        camera = frame.camera
        digest.update(f"{frame.name} {camera.width} {camera.height}".encode())
        digest.update(camera.K.tobytes() + camera.cam_from_world.tobytes() + frame.digest())
    for name in (SURFELS, TRUST):
        digest.update(_content(out / name))
    return digest.hexdigest()


def keep_mesh(out: Path, key: str) -> None:
    """The mesh is whole and its figures are noted; until the run ends it need not be made again."""
    if not (out / KEPT).is_dir():  # no run is going on
        return
    text = json.dumps({"key": key, "mesh": _content(out / MESH).hex()})
    try:
        with whole_file(out / KEPT / MARK) as temporary:
            temporary.write_text(text, encoding="utf-8")
    except OSError as error:
        if not by_the_machine(error):
            raise


def mesh_is_kept(out: Path, key: str) -> bool:
    """Whether mesh.ply is, byte for byte, the one that `keep_mesh` noted."""
    try:
        noted = json.loads((out / KEPT / MARK).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False
    return noted == {"key": key, "mesh": _content(out / MESH).hex()}


def _content(path: Path) -> bytes:
    """SHA-256 of a file; nothing without one."""
    digest = hashlib.sha256()
    try:
        with path.open("rb") as file:
            while chunk := file.read(CHUNK):
                digest.update(chunk)
    except OSError:
        return b""
    return digest.digest()
