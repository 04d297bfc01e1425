"""What rendering on a GPU should take, on paper.

python -m room2dgs.tools.roofline
"""

from __future__ import annotations

import argparse
import shlex
import sys
from pathlib import Path

from room2dgs.commit import commit
from room2dgs.files import whole_file
from room2dgs.json_files import update_json
from room2dgs.report.table import markdown, terminal
from room2dgs.tools.command_line import command_line
from room2dgs.tools.roofline.cost import REACHED
from room2dgs.tools.roofline.devices import DEVICES
from room2dgs.tools.roofline.tables import COUNTS, SIZES, case, tables

HELP = """Counts the work of a view of the box room (of `bench raster`) in the CPU's tile lists, multiplies it by what
each CUDA kernel does for a surfel, an entry of a tile's list and a hit, and divides by what GPUs can do at most;
likewise for gsplat's 2DGS kernels. No GPU is needed; docs/studies/gpu.md has what one measured."""


@command_line("roofline")
def main(argv: list[str]) -> int:
    """Count, print the tables, write them where --json and --markdown say."""
    parser = argparse.ArgumentParser(prog="roofline", description=HELP)
    parser.add_argument("--quick", action="store_true", help="the smallest case alone")
    parser.add_argument("--json", type=Path, help="also write all figures here")
    parser.add_argument("--markdown", type=Path, help="also write the tables here")
    args = parser.parse_args(argv)
    sizes, counts = (SIZES[:1], COUNTS[:1]) if args.quick else (SIZES, COUNTS)
    rows = [case(*size, count) for size in sizes for count in counts]
    made = tables(rows, rows[min(1, len(rows) - 1)])
    command = shlex.join(["python", "-m", "room2dgs.tools.roofline", *argv])
    reached = ", ".join(f"{name} {share:.0%}" for name, share in REACHED.items())
    note = f"commit {commit()}; of each bound is thought to be reached: {reached}"
    print(command, note, *map(terminal, made), sep="\n")
    if args.json:
        args.json.parent.mkdir(parents=True, exist_ok=True)
        devices = [device._asdict() for device in DEVICES]
        update_json(args.json, {"command": command, "commit": commit(), "devices": devices, "cases": rows})
    if args.markdown:
        args.markdown.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(args.markdown) as temporary:
            temporary.write_text("\n\n".join([f"`{command}`", note, *map(markdown, made)]) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
