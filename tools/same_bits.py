"""Whether a change changes results: the same runs by an older commit and by this checkout, compared bit for bit.

    python -m room2dgs.tools.same_bits COMMIT WORK scene.path=demo/room prior=room_prior [+ scene.path=other ...]

The older commit is built in WORK/old, once, with an environment of its own over this one's packages. Each group of
settings (groups are apart by +) is a run by both, in WORK/runs; meshes, surfels, poses, prior maps and pictures are
then compared. Exit code 1 if anything differs.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import shutil
import subprocess
import sys
import sysconfig
import venv
import zipfile
from pathlib import Path

from room2dgs.errors import InputError
from room2dgs.tools.command_line import command_line

ROOT = Path(__file__).resolve().parents[1]
# what a run leaves that holds results and no times, machines or versions
RESULTS = (
    "mesh.ply", "surfels.safetensors", "poses.json", "priors.csv", "trust.npz", "priors/**/*", "renders/**/*.png",
    "export/*", "eval/*.ply",
)  # fmt: skip


def built(commit: str, work: Path) -> Path:
    """The python of an environment in which an older commit is installed.

    Raises:
        InputError: there is no such commit.
        CalledProcessError: it cannot be built.
    """
    source, environment = work / "old" / "source", work / "old" / "venv"
    python = environment / "bin" / "python"
    asked = ["git", "rev-parse", "--verify", "-q", f"{commit}^{{commit}}"]
    named = subprocess.run(asked, check=False, cwd=ROOT, capture_output=True, text=True)
    if named.returncode:
        raise InputError(f"{commit} is no commit of {ROOT}; name one that `git log` shows")
    whole = named.stdout.strip()
    done = work / "old" / whole
    if done.exists():
        return python
    shutil.rmtree(work / "old", ignore_errors=True)
    source.mkdir(parents=True)
    archive = subprocess.run(["git", "archive", whole], cwd=ROOT, capture_output=True, check=True).stdout
    subprocess.run(["tar", "-x", "-C", str(source)], input=archive, check=True)
    venv.create(environment, with_pip=True)
    purelib = Path(sysconfig.get_path("purelib", vars={"base": str(environment), "platbase": str(environment)}))
    # a line of a path: this environment's packages, but not its own link to this checkout
    (purelib / "packages.pth").write_text(sysconfig.get_path("purelib") + "\n")
    install = ["-m", "pip", "install", "-q", "--no-build-isolation", "--no-deps", "--ignore-installed", str(source)]
    subprocess.run([str(python), *install], check=True)
    done.touch()
    return python


def run(python: Path, settings: list[str], out: Path) -> None:
    """One run, unless it is there; its log goes to a file beside it.

    Raises:
        InputError: it failed.
    """
    if (out / "metrics.json").exists():
        return
    shutil.rmtree(out, ignore_errors=True)
    out.parent.mkdir(parents=True, exist_ok=True)
    path = out.parent / f"{out.name}.log"
    with path.open("w") as log:
        command = [str(python), "-m", "room2dgs", "run", *settings, f"out={out}"]
        environment = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
        done = subprocess.run(command, check=False, cwd=out.parent, stdout=log, stderr=log, env=environment)
    if done.returncode:
        raise InputError(f"the run in {out} failed (exit {done.returncode}); {path} says why")


def results(out: Path) -> dict[str, str]:
    """File -> digest of its content; an archive's entries count, not their times."""
    found = {}
    for pattern in RESULTS:
        for path in sorted(out.glob(pattern)):
            if path.is_file():
                found[str(path.relative_to(out))] = digest(path)
    return found


def digest(path: Path) -> str:
    if path.suffix == ".npz":
        with zipfile.ZipFile(path) as archive:
            content = b"".join(name.encode() + archive.read(name) for name in sorted(archive.namelist()))
        return hashlib.sha256(content).hexdigest()
    return hashlib.sha256(path.read_bytes()).hexdigest()


def compared(old: Path, new: Path) -> list[str]:
    """A line for each file that differs, or that only one of the runs has."""
    before, after = results(old), results(new)
    lines = []
    for name in sorted(before | after):
        if before.get(name) != after.get(name):
            how = (
                "only the older has it" if name not in after else "only the newer has it" if name not in before else ""
            )
            lines.append(f"  {name}: {how or 'differs'}")
    return lines


def groups(words: list[str]) -> list[list[str]]:
    """Settings, apart by +."""
    found: list[list[str]] = [[]]
    for word in words:
        if word == "+":
            found.append([])
        else:
            key, _, value = word.partition("=")
            found[-1].append(f"{key}={Path(value).absolute()}" if key == "scene.path" else word)
    return [group for group in found if group]


@command_line("same_bits")
def main(argv: list[str]) -> None:
    """Prints a line a group, and one for each file that differs."""
    parser = argparse.ArgumentParser(prog="python -m room2dgs.tools.same_bits", description=__doc__.split("\n")[0])
    parser.add_argument("commit")
    parser.add_argument("work", type=Path)
    parser.add_argument("settings", nargs="+")
    arguments = parser.parse_args(argv)
    work = arguments.work.absolute()
    python = built(arguments.commit, work)
    different = 0
    for number, settings in enumerate(groups(arguments.settings)):
        old, new = (work / "runs" / f"{number}_{which}" for which in ("old", "new"))
        shutil.rmtree(new, ignore_errors=True)
        run(python, settings, old)
        run(Path(sys.executable), settings, new)
        lines = compared(old, new)
        same = len(results(new)) - sum("only the older" not in line for line in lines)
        print(f"{' '.join(settings)}: {same} files the same bits, {len(lines)} differ", flush=True)
        print("\n".join(lines), end="\n" if lines else "")
        different += bool(lines)
    if different:
        raise SystemExit(1)


if __name__ == "__main__":
    sys.exit(main())
