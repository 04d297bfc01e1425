"""Print what pyproject.toml asks for, one requirement a line: its own build, its dependencies and the extras named.

`python .ci/requirements.py dev > requirements.txt`

pip cannot install a project's dependencies without the project. The Makefile needs just that: dependencies are
built in isolation, as their authors expect, our extension is not, so that it finds the same compiler tools at
every rebuild. Runs before anything is installed, so the standard library and pip must do.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

try:
    import tomllib
except ModuleNotFoundError:  # Python 3.10
    from pip._vendor import tomli as tomllib


def requirements(pyproject: dict, extras: list[str]) -> list[str]:
    """All requirements of the table of a pyproject.toml; `name[extra]` of the project itself is written out.

    Raises:
        KeyError: the project has no such extra.
    """
    project = pyproject["project"]
    itself = re.compile(rf"{re.escape(project['name'])}\[([\w,-]+)\]$")
    wanted = [*pyproject["build-system"]["requires"], *project["dependencies"]]
    for extra in extras:
        for requirement in project["optional-dependencies"][extra]:
            if match := itself.match(requirement):
                wanted += requirements(pyproject, match[1].split(","))
            else:
                wanted.append(requirement)
    return list(dict.fromkeys(wanted))


def main() -> None:
    pyproject = Path(__file__).resolve().parents[1] / "pyproject.toml"
    print("\n".join(requirements(tomllib.loads(pyproject.read_text(encoding="utf-8")), sys.argv[1:])))


if __name__ == "__main__":
    main()
