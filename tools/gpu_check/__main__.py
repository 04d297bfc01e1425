"""A backend held against the reference and the CPU, and timed; what `make gpu-check` runs.

python -m room2dgs.tools.gpu_check
"""

from __future__ import annotations

import argparse
import shlex
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from room2dgs import cuda_state
from room2dgs.errors import InputError
from room2dgs.json_files import update_json
from room2dgs.logs import LOGGER
from room2dgs.report.table import Table, table, terminal
from room2dgs.tools.command_line import command_line

HELP = """Renders the hard cases with a backend and compares images and every gradient with the float64 reference and
with the CPU's kernels; times forward and backward (and gsplat's 2DGS on the same surfels, if it is installed); trains
and scores the demo room with it and with the CPU's. Whatever the time does not suffice for is left out and named. The
exit code is 1 if a case is beyond its bound, if a second run gives other bits, or if the demo's F-score differs by more
than 0.005."""
SPEEDS = (
    (640, 480, 100_000, "surfels"), (640, 480, 500_000, "surfels"), (1296, 968, 500_000, "surfels"),
    (1296, 968, 2_000_000, "surfels"), (640, 480, 100_000, "Gaussians"), (1296, 968, 500_000, "Gaussians"),
)  # fmt: skip
TINY_SPEEDS = ((160, 120, 2000, "surfels"), (160, 120, 2000, "Gaussians"))
SAME_F = 0.005
Row = dict[str, Any]


@command_line("gpu_check")
def main(argv: list[str]) -> int:
    """Check, print one table, write JSON.

    Raises:
        InputError: no such backend, or nothing for it to run on.
    """
    parser = argparse.ArgumentParser(prog="gpu_check", description=HELP)
    parser.add_argument(
        "--backend", default="cuda", help="a rasterizer by name, and render.device of the run (default: cuda)"
    )
    parser.add_argument("--minutes", type=float, default=8.0, help="begin nothing new after so long")
    parser.add_argument("--only", default="", metavar="TEXT", help="hard cases whose name has this in it")
    parser.add_argument("--tiny", action="store_true", help="time the smallest picture alone: a test of this command")
    parser.add_argument("--room", type=Path, help="a capture to train instead of the demo room")
    parser.add_argument("--json", type=Path, help="also write all figures here")
    parser.add_argument("settings", nargs="*", metavar="KEY=VALUE", help="of the runs on the room")
    args = parser.parse_args(argv)
    from room2dgs.commit import commit
    from room2dgs.runs.metrics import machine
    from room2dgs.tools.gpu_check.rendering import device_of

    device = device_of(args.backend)
    end = time.perf_counter() + 60 * args.minutes
    where = {
        "command": shlex.join(["python", "-m", "room2dgs.tools.gpu_check", *argv]),
        "machine": machine(), "commit": commit(), "backend": args.backend, "device": device,
        "driver": cuda_state.driver().text, "torch": cuda_state.in_torch().text,
    }  # fmt: skip
    print(where["command"], f"{where['machine']}; {where['driver']}; commit {where['commit']}", sep="\n", flush=True)
    found, left_out = _checked(args, end)
    figures = {**where, **found, "left_out": left_out, "failed": failures(found)}
    print(terminal(summary(found)))
    for lines in (("left out for want of time", left_out), ("FAILED", figures["failed"])):
        if lines[1]:
            print(f"{lines[0]}: {', '.join(lines[1])}")
    if args.json:
        args.json.parent.mkdir(parents=True, exist_ok=True)
        update_json(args.json, figures)
        print(f"{args.json}: to be pasted into docs/results.md")
    return 1 if figures["failed"] else 0


def _checked(args: argparse.Namespace, end: float) -> tuple[dict[str, list[Row]], list[str]]:
    """Rows of all three parts, and what was left out."""
    from room2dgs.tools.gpu_check.corpus import corpus_row
    from room2dgs.tools.gpu_check.speed import speed_row
    from room2dgs.tools.numerics.measure import ALL_SCENES

    found: dict[str, list[Row]] = {"corpus": [], "speed": [], "demo": []}
    left_out: list[str] = []

    def do(kind: str, name: str, work: Callable[[], Row]) -> None:
        if time.perf_counter() > end:
            left_out.append(name)
            return
        print(f"... {name}", flush=True)
        row = work()
        found[kind].append(row)
        print("   ", "; ".join(LINES[kind](row)[1:]), flush=True)  # a run that is killed has said what it found

    names = [name for name in ALL_SCENES if args.only in name]
    if not names:
        raise InputError(f"no case has {args.only!r} in its name; leave --only out to see all")
    speeds = TINY_SPEEDS if args.tiny else SPEEDS
    for width, height, count, kind in speeds:
        name = f"{count} {kind} at {width}x{height}"
        do("speed", name, partial(speed_row, args.backend, width, height, count, kind))
    with tempfile.TemporaryDirectory() as folder:
        _demo(args, Path(folder), do)
    for name in names:
        do("corpus", name, partial(corpus_row, name, args.backend))
    return found, left_out


def _demo(args: argparse.Namespace, folder: Path, do: Callable[[str, str, Callable[[], Row]], None]) -> None:
    """The room by both rasterizers."""
    from room2dgs.commands.run import main as run
    from room2dgs.demo_room.make import make_room
    from room2dgs.tools.gpu_check.demo import demo_row

    def row(backend: str) -> Row:
        room = args.room or folder / "room"
        if args.room is None and not room.exists():
            make_room(room)
        return demo_row(run, folder, room, backend, ["prior=room_prior", "report.enabled=false", *args.settings])

    handlers = list(LOGGER.handlers)
    for backend in dict.fromkeys((args.backend, "cpu")):
        do("demo", f"the demo room by {backend}", partial(row, backend))
    LOGGER.handlers = handlers  # the runs' logs lie in a folder that goes


def failures(found: dict[str, list[Row]]) -> list[str]:
    """What is beyond its bound, by name."""
    failed = [row["case"] for row in found["corpus"] if not row["passed"]]
    scores = [row["f_score_5cm"] for row in found["demo"] if row["f_score_5cm"] is not None]
    if len(scores) == 2 and abs(scores[0] - scores[1]) > SAME_F:
        failed.append(f"the demo's F-scores {scores[0]:.3f} and {scores[1]:.3f}")
    return failed


def summary(found: dict[str, list[Row]]) -> Table:
    """One table of all three parts."""
    rows = [LINES[kind](row) for kind in ("speed", "demo", "corpus") for row in found[kind]]
    columns = {"what": lambda x: x[0], "found": lambda x: x[1], "beside": lambda x: x[2]}
    return table("GPU check", columns, rows)


def _speed(row: Row) -> tuple[str, str, str]:
    ours, theirs = row["ours"], row["gsplat"]
    beside = "gsplat is not installed" if row["kind"] == "surfels" else ""
    if theirs:
        ratio = sum(theirs.values()) / sum(ours.values())
        beside = f"gsplat {theirs['forward_ms']:.2f} + {theirs['backward_ms']:.2f}: {ratio:.2f} times ours"
    what = f"{row['surfels']} {row['kind']}, {row['width']}x{row['height']}"
    return what, f"{ours['forward_ms']:.2f} + {ours['backward_ms']:.2f} ms", beside


def _room(row: Row) -> tuple[str, str, str]:
    score = "no ground truth" if row["f_score_5cm"] is None else f"F@5cm {row['f_score_5cm']:.3f}"
    return f"demo room by {row['backend']}", score, f"training {row['train_s']:.1f} s of {row['all_s']:.1f} s"


def _case(row: Row) -> tuple[str, str, str]:
    verdict = "within" if row["passed"] else "BEYOND"
    beside = f"{row['from_cpu']:.1e} from the CPU's" + ("" if row["same_bits_again"] else ", OTHER BITS when run again")
    return row["case"], f"{verdict}: {row['error']:.1e} of {row['bound']:.0e} ({row['worst']})", beside


LINES: dict[str, Callable[[Row], tuple[str, str, str]]] = {"speed": _speed, "demo": _room, "corpus": _case}


if __name__ == "__main__":
    sys.exit(main())
