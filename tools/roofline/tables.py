"""All cases and devices, as rows of numbers and as tables."""

from __future__ import annotations

from functools import partial
from typing import Any

from room2dgs.bench.raster_scene import box_surfels, inside_view
from room2dgs.report.table import Table, table
from room2dgs.tools.roofline import gsplat, ours
from room2dgs.tools.roofline.cost import Kernel, expected, total
from room2dgs.tools.roofline.devices import DEVICES
from room2dgs.tools.roofline.scene import GSPLAT_DEFAULT_NEAR_M, Counts, boxes, measured
from room2dgs.tools.roofline.training import training_table

SIZES = ((640, 480), (1296, 968))
COUNTS = (100_000, 500_000, 2_000_000)
SETS = {"ours": ours.kernels(), "gsplat": gsplat.kernels()}
Row = dict[str, Any]


def case(width: int, height: int, surfels: int) -> Row:
    """Counts of the box room, and each kernel's work and time on each device."""
    found = dict(zip(SETS, measured(box_surfels(surfels), *inside_view(width, height), width, height), strict=True))
    row: Row = {"width": width, "height": height, "surfels": surfels}
    everywhere = boxes(box_surfels(surfels), *inside_view(width, height), width, height, near_m=GSPLAT_DEFAULT_NEAR_M)
    row["gsplat_entries_by_default"] = float(everywhere[0].sum())
    for who, counts in found.items():
        row[who] = {
            "counts": counts._asdict(),
            "kernels": [_kernel_row(kernel, counts) for kernel in SETS[who]],
        }
    return row


def _kernel_row(kernel: Kernel, counts: Counts) -> Row:
    work = total(kernel, counts)
    times = {}
    for device in DEVICES:
        bound, likely, binding = expected(kernel, counts, device)
        times[device.name] = {"bound_ms": 1e3 * bound, "expected_ms": 1e3 * likely, "binding": binding}
    return {"name": kernel.name, "backward": kernel.backward, "work": work._asdict(), "times": times}


def milliseconds(row: Row, who: str, device: str, backward: bool | None = None, which: str = "expected_ms") -> float:
    """Sum over the kernels of one rasterizer; forward, backward or both."""
    chosen = [k for k in row[who]["kernels"] if backward is None or k["backward"] == backward]
    return sum(k["times"][device][which] for k in chosen)


def tables(rows: list[Row], shown: Row) -> list[Table]:
    """What there is to do, what it takes, and of the case `shown` each kernel."""
    named = [(_name(row), row) for row in rows]
    work = table(
        "Counts of a view",
        {
            "case": lambda x: x[0],
            "seen": lambda x: _count(x[1], "ours", "visible"),
            "entries": lambda x: _count(x[1], "ours", "entries"),
            "gsplat's": lambda x: _count(x[1], "gsplat", "entries"),
            f"near {GSPLAT_DEFAULT_NEAR_M} m": lambda x: f"{x[1]['gsplat_entries_by_default'] / 1e3:.0f} k",
            "pairs looked at, a pixel": lambda x: _per_pixel(x[1], "ours"),
            "gsplat's ": lambda x: _per_pixel(x[1], "gsplat"),
            "blended": lambda x: f"{x[1]['ours']['counts']['kept'] / x[1]['ours']['counts']['pixels']:.0f}",
            "lanes at work": lambda x: f"{_lanes(x[1]):.0%}",
        },
        named,
    )
    speed = table(
        "Expected milliseconds, forward + backward (bound)",
        {
            "case": lambda x: x[0],
            **{
                f"{d.name}{' gsplat' if who == 'gsplat' else ''}": partial(_pair_of, who, d.name)
                for d in DEVICES
                for who in SETS
            },
            "gsplat / ours": lambda x: " ".join(
                f"{milliseconds(x[1], 'gsplat', d.name) / milliseconds(x[1], 'ours', d.name):.1f}" for d in DEVICES
            ),
        },
        named,
    )
    parts = [(who, kernel) for who in SETS for kernel in shown[who]["kernels"]]
    each = table(
        f"Kernels at {_name(shown)}",
        {
            "kernel": lambda x: f"{x[0]}: {x[1]['name']}",
            "Gflop": lambda x: f"{x[1]['work']['flops'] / 1e9:.2f}",
            "M warp instructions": lambda x: f"{x[1]['work']['instructions'] / 1e6:.1f}",
            "of them float64": lambda x: f"{x[1]['work']['fp64'] / 1e6:.1f}",
            "M shared, shuffles": lambda x: f"{x[1]['work']['mio'] / 1e6:.1f}",
            "MB memory": lambda x: f"{x[1]['work']['dram'] / 1e6:.0f}",
            "MB L2": lambda x: f"{x[1]['work']['l2'] / 1e6:.0f}",
            "M atomics": lambda x: f"{x[1]['work']['atomics'] / 1e6:.1f}",
            **{d.name: partial(lambda d, x: _bound(x[1]["times"][d.name]), d) for d in DEVICES},
        },
        parts,
    )
    return [work, speed, each, training_table()]


def _name(row: Row) -> str:
    count = row["surfels"]
    return f"{count // 1000} k, {row['width']}x{row['height']}" if count < 10**6 else (
        f"{count / 1e6:.0f} M, {row['width']}x{row['height']}"
    )  # fmt: skip


def _count(row: Row, who: str, what: str) -> str:
    return f"{row[who]['counts'][what] / 1e3:.0f} k"


def _per_pixel(row: Row, who: str) -> str:
    counts = row[who]["counts"]
    return f"{32 * counts['forward_warps'] / counts['pixels']:.0f}"


def _lanes(row: Row) -> float:
    """Of the warps that blend a surfel, the lanes that do."""
    counts = row["ours"]["counts"]
    return counts["kept"] / max(1.0, 32 * counts["kept_warps"])


def _pair_of(who: str, device: str, named: tuple[str, dict[str, Any]]) -> str:
    return _pair(named[1], who, device)


def _pair(row: Row, who: str, device: str) -> str:
    both = (milliseconds(row, who, device, backward) for backward in (False, True))
    bound = milliseconds(row, who, device, which="bound_ms")
    return " + ".join(f"{x:.2f}" for x in both) + f" ({bound:.2f})"


def _bound(times: Row) -> str:
    return f"{times['expected_ms']:.3f} ms, {times['binding']}"
