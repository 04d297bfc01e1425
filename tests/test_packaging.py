"""The wheel works away from the checkout and puts nothing but room2dgs on anyone's path."""

from __future__ import annotations

import subprocess
import sys
import sysconfig
import zipfile
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).resolve().parents[1]
PIP = [sys.executable, "-m", "pip", "--disable-pip-version-check", "-q"]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    options = ["--no-deps", "--no-build-isolation", "--no-index", "-w", folder]
    subprocess.run([*PIP, "wheel", *options, CHECKOUT], check=True)
    (path,) = folder.glob("room2dgs-*.whl")
    return path


@pytest.fixture(scope="module")
def installed(wheel: Path, tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("installed")
    subprocess.run([*PIP, "install", "--no-deps", "--no-index", "--target", folder, wheel], check=True)
    return folder


def python_away_from_the_checkout(installed: Path, code: str) -> subprocess.CompletedProcess:
    """Runs code with the installed wheel first on the path and everybody else's libraries behind it.

    -I keeps the working folder and the environment off the path, -S the .pth files, and with them the finder
    of an editable install.
    """
    libraries = {sysconfig.get_path("purelib"), sysconfig.get_path("platlib")}
    path = f"import sys; sys.path[:0] = [{str(installed)!r}]; sys.path += {sorted(libraries)!r}\n"
    command = [sys.executable, "-I", "-S", "-c", path + code]
    return subprocess.run(command, cwd=installed.parent, capture_output=True, text=True, timeout=120, check=False)


def test_only_one_top_level_package(wheel):
    top = {name.partition("/")[0] for name in zipfile.ZipFile(wheel).namelist()}
    assert {name for name in top if not name.endswith(".dist-info")} == {"room2dgs"}


def test_configuration_scores_tools_network_and_kernels_travel_inside(wheel):
    names = set(zipfile.ZipFile(wheel).namelist())
    for folder in ("conf", "eval", "tools"):
        for file in (CHECKOUT / folder).rglob("*"):
            if file.suffix in (".py", ".yaml"):
                assert f"room2dgs/{file.relative_to(CHECKOUT).as_posix()}" in names
    assert {"room2dgs/priors/network/room_prior.onnx", "room2dgs/priors/network/README.md"} <= names
    assert any(name.startswith("room2dgs/_C.") for name in names)
    assert not any(name.endswith((".cpp", ".h", ".cu")) for name in names)
    assert any(name.endswith("licenses/LICENSE") for name in names)


def test_console_command(wheel):
    archive = zipfile.ZipFile(wheel)
    (name,) = (name for name in archive.namelist() if name.endswith("entry_points.txt"))
    assert "room2dgs=room2dgs.cli:main" in archive.read(name).decode().replace(" ", "")


def test_import_and_configuration_elsewhere(installed):
    done = python_away_from_the_checkout(
        installed,
        """
import importlib.util
import room2dgs, room2dgs._C, room2dgs.eval.scoring, room2dgs.tools
from room2dgs.config import conf_dir, load_config
for module in (room2dgs, room2dgs._C, room2dgs.eval.scoring, room2dgs.tools):
    print(module.__file__)
print(conf_dir())
assert load_config(["scene.path=a", "out=b"]).train.iterations > 0
assert all(importlib.util.find_spec(name) is None for name in ("eval", "conf", "tools"))
""",
    )
    assert done.returncode == 0, done.stderr
    assert all(line.startswith(str(installed)) for line in done.stdout.splitlines()), done.stdout


def test_doctor_elsewhere(installed):
    done = python_away_from_the_checkout(installed, "from room2dgs.cli import main; sys.exit(main(['doctor']))")
    assert done.returncode == 0, done.stdout + done.stderr
    assert "instructions" in done.stdout
    assert "Nothing is missing" in done.stdout
