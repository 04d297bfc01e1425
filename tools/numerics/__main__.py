"""float32 against float64 on hard cases.

python -m room2dgs.tools.numerics
"""

from __future__ import annotations

import argparse
import shlex
import sys
from pathlib import Path
from typing import Any

import torch

from room2dgs import _C
from room2dgs.commit import commit
from room2dgs.errors import InputError
from room2dgs.files import whole_file
from room2dgs.json_files import update_json
from room2dgs.report.table import Table, markdown, terminal
from room2dgs.runs.metrics import machine
from room2dgs.tools.command_line import command_line
from room2dgs.tools.numerics.measure import measured
from room2dgs.tools.numerics.tables import tables
from room2dgs.tools.numerics.tradeoff import tradeoff, tradeoff_table

HELP = """Renders hard scenes with the kernels (float32) and the reference (float64), and feeds loss terms, stereo and
the joint depth optimisation with hard input. Prints the worst relative error of values and of every gradient, whether
everything is finite, and whether moving the scene, its unit, the surfels' order or the threads change anything. The
exit code is 1 if a case is beyond its bound."""


@command_line("numerics")
def main(argv: list[str]) -> int:
    """Measure, print the tables, write them where --json and --markdown say.

    Raises:
        InputError: no case has the wanted name; variants cannot be built or scored.
    """
    parser = argparse.ArgumentParser(prog="numerics", description=HELP)
    parser.add_argument(
        "--only",
        default="",
        metavar="TEXT",
        help="cases whose name has this in it (of --tradeoff: one of these, apart by commas)",
    )
    parser.add_argument("--quick", action="store_true", help="without the 4K picture")
    parser.add_argument(
        "--tradeoff",
        type=Path,
        metavar="FOLDER",
        help="instead: time and error of each approximation, built from the sources in this folder",
    )
    parser.add_argument(
        "--score",
        type=Path,
        action="append",
        default=[],
        metavar="CAPTURE",
        help="with --tradeoff: also F-scores of a run of this capture with each variant; may be given again",
    )
    parser.add_argument("settings", nargs="*", metavar="KEY=VALUE", help="of the runs that --score asks for")
    parser.add_argument("--json", type=Path, help="also write all figures here")
    parser.add_argument("--markdown", type=Path, help="also write the tables here")
    args = parser.parse_args(argv)
    if not args.tradeoff and (args.score or args.settings):
        raise InputError("runs are scored by --tradeoff FOLDER --score CAPTURE KEY=VALUE ...; one of these is missing")
    command = shlex.join(["python", "-m", "room2dgs.tools.numerics", *argv])
    where = f"{machine()}; commit {commit()}; kernels {_C.isa()}"
    if args.tradeoff:
        captures = [str(capture.absolute()) for capture in args.score]
        if len({capture.name for capture in args.score}) < len(captures):
            raise InputError("--score names two folders alike; link one of them under another name")
        rows = tradeoff(args.tradeoff.absolute(), args.only, _tell, captures, args.settings)
        _give(args, command, where, [tradeoff_table(rows)], {"tradeoff": rows})
        return 0
    threads = torch.get_num_threads()
    torch.set_num_threads(1)  # small tensors: more threads wait for one another
    try:
        found = measured(args.only, args.quick, _tell)
    finally:
        torch.set_num_threads(threads)
    rows = [row for kind in found.values() for row in kind]
    if not rows:
        raise InputError(f"no case has {args.only!r} in its name; leave --only out to see all")
    failed = [row["case"] for row in rows if not row["passed"]]
    verdict = f"{len(rows) - len(failed)} of {len(rows)} cases within their bounds"
    if failed:
        verdict += f"; beyond them: {', '.join(failed)}"
    _give(args, command, where, tables(found), {"failed": failed, **found}, verdict)
    return 1 if failed else 0


def _tell(name: str) -> None:
    print(f"... {name}", flush=True)


def _give(
    args: argparse.Namespace, command: str, where: str, made: list[Table], figures: dict[str, Any], verdict: str = ""
) -> None:
    """Print, and write what is asked for."""
    print(command, where, *(terminal(one) for one in made), *([verdict] if verdict else []), sep="\n")
    if args.json:
        args.json.parent.mkdir(parents=True, exist_ok=True)
        head = {"command": command, "machine": machine(), "commit": commit(), "isa": _C.isa()}
        update_json(args.json, {**head, **figures})
    if args.markdown:
        args.markdown.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(args.markdown) as temporary:
            parts = [f"`{command}`", where, *(markdown(one) for one in made), verdict]
            temporary.write_text("\n\n".join(part for part in parts if part) + "\n", encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
