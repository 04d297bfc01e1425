"""Damage of any text or header of every layout: what is read is right, or one sentence says why not.

No traceback, no memory beyond a small multiple of the files, no number that is not finite; and where the damage changed
no number into another, no silent change of poses, intrinsics or depth.
"""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings

from room2dgs.captures.read import read_scene
from room2dgs.errors import InputError
from room2dgs.tools.capture_layouts.registry import LAYOUTS
from tests.captures.known_scene import known, wrong
from tests.captures.mutations import cases, mutated
from tests.captures.test_deleted_files import files_of

EXAMPLES = 120  # of each layout
SPARE_MB, TIMES = 96, 40  # what reading may take beside the files' sizes


def memory_mb(what: str) -> float:
    """VmRSS or VmHWM of this process."""
    return int(Path("/proc/self/status").read_text().partition(f"{what}:")[2].split()[0]) / 1024


def forget_peak() -> None:
    Path("/proc/self/clear_refs").write_text("5")


def damageable(root: Path, file: str) -> bool:
    """Photos and maps are many and alike: the first of each folder and ending stands for them."""
    path = root / file
    alike = sorted(other.name for other in path.parent.iterdir() if other.suffix == path.suffix)
    return path.name == alike[0] or path.suffix in (".json", ".bin") or len(alike) < 3


@pytest.mark.slow
@pytest.mark.parametrize("name", LAYOUTS)
def test_damage_gives_what_is_right_or_a_sentence(written, settings_of, made, name):
    root = written(name)
    config = settings_of(root, name)
    whole = read_scene(config)
    truth, told = known(whole, made), {*whole.notes, *whole.warnings}
    files = [file for file in files_of(root) if damageable(root, file)]
    size_mb = sum((root / file).stat().st_size for file in files_of(root)) / 1e6

    @settings(
        max_examples=EXAMPLES, deadline=None, suppress_health_check=list(HealthCheck), database=None, derandomize=True
    )
    @given(cases(files))
    def read(case) -> None:
        file, mutation, at, word, must_be_right = case
        data = (root / file).read_bytes()
        (root / file).write_bytes(mutated(data, file, mutation, at, word))
        before = memory_mb("VmRSS")
        forget_peak()
        try:
            scene = read_scene(config)
            if scene.given_points is not None:
                points = scene.given_points()
                assert np.isfinite(points.xyz).all()
            for frame in scene.frames:
                assert np.isfinite(frame.camera.cam_from_world).all() and np.isfinite(frame.camera.K).all()
            if must_be_right and {*scene.notes, *scene.warnings} <= told:
                assert not wrong(scene, made, truth)
        except InputError as error:
            assert "\n" not in str(error)
        finally:
            (root / file).write_bytes(data)
        assert memory_mb("VmHWM") - before < SPARE_MB + TIMES * size_mb

    read()
    shutil.rmtree(root)
