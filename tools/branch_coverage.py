"""Prints the coverage of the tests that ran last, package by package.

    make coverage

A branch is a jump from one line to another that some condition decides; it is covered when a test takes it.
"""

from __future__ import annotations

import argparse
import json
from collections import Counter
from pathlib import Path

from coverage import Coverage

from room2dgs.errors import InputError
from room2dgs.report.table import Table, table, terminal
from room2dgs.tools.command_line import command_line

ROOT = Path(__file__).resolve().parents[1]
FIGURES = ("num_statements", "covered_lines", "num_branches", "covered_branches")


def package_of(path: Path) -> str:
    """room2dgs/mesh/fuse.py -> mesh, eval/scoring.py -> eval, room2dgs/cli.py -> the modules at the top."""
    parts = path.relative_to(ROOT).parts if path.is_absolute() else path.parts
    inside = parts[1:] if parts[0] == "room2dgs" else parts
    return inside[0] if len(inside) > 1 else "(modules)"


def by_package(files: dict[str, dict[str, dict[str, int]]]) -> dict[str, Counter[str]]:
    """Package -> its figures, added up over its files.

    Args:
        files: of coverage's JSON report.
    """
    found: dict[str, Counter[str]] = {}
    for path, entry in files.items():
        summary = entry["summary"]
        found.setdefault(package_of(Path(path)), Counter()).update({name: summary[name] for name in FIGURES})
    return dict(sorted(found.items()))


def coverage_table(packages: dict[str, Counter[str]]) -> Table:
    """A line for each package, then all of them."""
    rows = [*packages.items(), ("all", sum(packages.values(), Counter()))]
    columns = {
        "package": lambda row: row[0],
        "lines": lambda row: str(row[1]["num_statements"]),
        "covered": lambda row: _share(row[1]["covered_lines"], row[1]["num_statements"]),
        "branches": lambda row: str(row[1]["num_branches"]),
        "branches covered": lambda row: _share(row[1]["covered_branches"], row[1]["num_branches"]),
    }
    return table("Coverage", columns, rows)


def _share(part: int, whole: int) -> str:
    return f"{part / whole:.1%}" if whole else "-"


@command_line("branch_coverage")
def main(arguments: list[str]) -> None:
    """The command line."""
    parser = argparse.ArgumentParser(prog="branch_coverage", description="Print the coverage of the last tests.")
    parser.add_argument("data", type=Path, help="coverage's data file")
    data = parser.parse_args(arguments).data
    if not data.is_file():
        raise InputError(f"{data} is missing; make coverage writes it")
    coverage = Coverage(data_file=str(data), config_file=str(ROOT / "pyproject.toml"))
    coverage.load()
    report = data.with_name("coverage.json")
    coverage.json_report(outfile=str(report), ignore_errors=True)  # files that are gone since
    print(terminal(coverage_table(by_package(json.loads(report.read_text(encoding="utf-8"))["files"]))))


if __name__ == "__main__":
    raise SystemExit(main())
