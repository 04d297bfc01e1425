"""The sdist builds a wheel that works away from the checkout and puts nothing but room2dgs on anyone's path."""

from __future__ import annotations

import json
import os
import re
import runpy
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).resolve().parents[1]
PIP = [sys.executable, "-m", "pip", "--disable-pip-version-check", "-q"]

pytestmark = pytest.mark.slow  # the extension is compiled anew


@pytest.fixture(scope="module")
def sdist(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("sdist")
    code = f"from scikit_build_core.build import build_sdist; build_sdist({str(folder)!r})"
    subprocess.run([sys.executable, "-c", code], cwd=CHECKOUT, check=True, stdout=subprocess.DEVNULL)
    (path,) = folder.glob("room2dgs-*.tar.gz")
    return path


@pytest.fixture(scope="module")
def wheel(sdist: Path, tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    options = ["--no-deps", "--no-build-isolation", "--no-index", "-w", folder]
    subprocess.run([*PIP, "wheel", *options, sdist], check=True)
    (path,) = folder.glob("room2dgs-*.whl")
    return path


@pytest.fixture(scope="module")
def names(wheel: Path) -> set[str]:
    return set(zipfile.ZipFile(wheel).namelist())


@pytest.fixture(scope="module")
def installed(wheel: Path, tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("installed")
    subprocess.run([*PIP, "install", "--no-deps", "--no-index", "--target", folder, wheel], check=True)
    return folder


def python_away_from_the_checkout(installed: Path, code: str, *arguments: str) -> subprocess.CompletedProcess:
    """Runs code with the installed wheel first on the path and everybody else's libraries behind it.

    -I keeps the working folder and the environment off the path, -S the .pth files, and with them the finder
    of an editable install.
    """
    libraries = [path for path in sys.path if Path(path).name in ("site-packages", "dist-packages")]
    path = f"import sys; sys.path[:0] = [{str(installed)!r}]; sys.path += {libraries!r}\n"
    command = [sys.executable, "-I", "-S", "-c", path + code, *arguments]
    # nor is there a compiler, or any other program
    environment = {**os.environ, "PATH": str(installed.parent / "no_programs")}
    return subprocess.run(
        command, cwd=installed.parent, env=environment, capture_output=True, text=True, timeout=600, check=False
    )


def test_sdist_has_what_is_needed_to_build_test_and_cite(sdist):
    with tarfile.open(sdist) as archive:
        files = {name.partition("/")[2] for name in archive.getnames()}
    assert {"pyproject.toml", "CMakeLists.txt", "LICENSE", "README.md", "CITATION.cff", "CHANGELOG.md"} <= files
    assert {"room2dgs/csrc/module.cpp", "conf/config.yaml", "eval/__init__.py", "tools/make_captures.py"} <= files
    assert {"tests/test_packaging.py", "Makefile", ".ci/requirements.py", "constraints.txt"} <= files
    assert not [name for name in files if name.startswith((".venv", "build/", "demo/")) or name.endswith(".so")]


def test_only_one_top_level_package(names):
    top = {name.partition("/")[0] for name in names}
    assert {name for name in top if not name.endswith(".dist-info")} == {"room2dgs"}


def test_the_wheel_is_the_package_its_settings_and_its_scores_and_nothing_else(names):
    expected = {"room2dgs/commit.txt"}
    for folder, inside in (("conf", "room2dgs/conf"), ("eval", "room2dgs/eval"), ("room2dgs", "room2dgs")):
        for file in (CHECKOUT / folder).rglob("*"):
            built = {"csrc", "__pycache__"} & set(file.parts) or file.suffix == ".so"
            if file.is_file() and not built:
                expected.add(f"{inside}/{file.relative_to(CHECKOUT / folder).as_posix()}")
    packed = {name for name in names if name.startswith("room2dgs/") and not name.endswith("/")}
    (kernels,) = packed - expected
    assert kernels.startswith("room2dgs/_C.") and kernels.endswith(".so")
    assert expected <= packed
    assert {"room2dgs/py.typed", "room2dgs/_C/__init__.pyi", "room2dgs/_C/bench.pyi"} <= packed
    assert {
        f"room2dgs/depth/network/{name}" for name in ("room_prior.onnx", "depth_correction.onnx", "README.md")
    } <= packed
    assert any(name.endswith("licenses/LICENSE") for name in names)


def test_nothing_in_the_wheel_needs_a_checkout(wheel, names):
    archive = zipfile.ZipFile(wheel)
    for name in names:
        if name.endswith(".py"):
            found = re.findall(
                r"^\s*(?:from|import) (room2dgs\.tools|tests)\b", archive.read(name).decode(), re.MULTILINE
            )
            assert not found, f"{name} imports {found}"


def test_the_wheel_knows_the_commit_that_the_sdist_was_made_of(wheel, sdist):
    with tarfile.open(sdist) as archive:
        (member,) = (name for name in archive.getnames() if name.count("/") == 1 and name.endswith("/commit.txt"))
        noted = archive.extractfile(member).read()
    assert zipfile.ZipFile(wheel).read("room2dgs/commit.txt") == noted
    head = subprocess.run(["git", "rev-parse", "HEAD"], cwd=CHECKOUT, capture_output=True, text=True, check=False)
    if head.returncode == 0:
        assert noted.decode().strip().rstrip("+") == head.stdout.strip()


def test_console_command(wheel, names):
    (name,) = (name for name in names if name.endswith("entry_points.txt"))
    text = zipfile.ZipFile(wheel).read(name).decode()
    assert "room2dgs=room2dgs.cli:main" in text.replace(" ", "")


def test_import_and_configuration_elsewhere(installed):
    done = python_away_from_the_checkout(
        installed,
        """
import importlib.util
import room2dgs, room2dgs._C, room2dgs.eval.scoring
from room2dgs.config import conf_dir, load_config
for module in (room2dgs, room2dgs._C, room2dgs.eval.scoring):
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


def test_the_demo_room_is_made_elsewhere(installed, tmp_path):
    code = "from room2dgs.cli import main; sys.exit(main(sys.argv[1:]))"
    size = ["--frames", "2", "--width", "32", "--height", "24"]
    done = python_away_from_the_checkout(installed, code, "demo", str(tmp_path / "room"), *size)
    assert done.returncode == 0, done.stderr
    assert {path.name for path in (tmp_path / "room" / "color").iterdir()} == {"0.jpg", "1.jpg"}


def test_a_capture_is_reconstructed_with_the_shipped_network_and_scored_elsewhere(installed, wall, tmp_path):
    short = ["points.source=file", "seeds.voxel_m=0.1", "train.iterations=20", "mesh.voxel_m=0.05", "eval.samples=2000"]
    code = "from room2dgs.cli import main; sys.exit(main(sys.argv[1:]))"
    places = [f"scene.path={wall}", f"points.file={wall / 'points.ply'}", f"out={tmp_path / 'run'}"]
    done = python_away_from_the_checkout(installed, code, "run", *places, *short)
    assert done.returncode == 0, done.stdout + done.stderr
    metrics = json.loads((tmp_path / "run" / "metrics.json").read_text())
    assert metrics["priors"] == "room_prior"
    assert metrics["f_score_5cm"] > 0.5
    assert (tmp_path / "run" / "mesh.ply").is_file()


def test_requirements_for_make_are_those_of_the_project():
    requirements = runpy.run_path(str(CHECKOUT / ".ci" / "requirements.py"))["requirements"]
    pyproject = {
        "build-system": {"requires": ["builder"]},
        "project": {
            "name": "room",
            "dependencies": ["first>=1", "second"],
            "optional-dependencies": {"a": ["room[b]", "third"], "b": ["fourth", "second"]},
        },
    }
    assert requirements(pyproject, []) == ["builder", "first>=1", "second"]
    assert requirements(pyproject, ["a"]) == ["builder", "first>=1", "second", "fourth", "third"]
    with pytest.raises(KeyError):
        requirements(pyproject, ["c"])
