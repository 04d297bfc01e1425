"""The commit that the package was built from, for the records of runs."""

from __future__ import annotations

import subprocess
from functools import cache
from pathlib import Path

PACKAGE = Path(__file__).resolve().parent
BUILT_FROM = "commit.txt"  # written by the build; not beside a checkout's own files


@cache
def commit() -> str | None:
    """The commit, "+" behind it when files differ from it; None where nobody knows.

    A wheel knows it since it was built. In a checkout, whose files change, git is asked once a process.
    """
    built_from = PACKAGE / BUILT_FROM
    if built_from.is_file():
        return built_from.read_text(encoding="utf-8").strip() or None
    root = PACKAGE.parent
    if not (root / ".git").exists():
        return None
    try:
        head = _git(root, "rev-parse", "HEAD")
        return head + "+" if _git(root, "status", "--porcelain") else head
    except (OSError, subprocess.SubprocessError):
        return None


def _git(root: Path, *arguments: str) -> str:
    done = subprocess.run(["git", "-C", str(root), *arguments], capture_output=True, text=True, check=True, timeout=10)
    return done.stdout.strip()
