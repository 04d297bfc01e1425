"""Work of a kernel for each item of what it goes over, and the time that it takes at best."""

from __future__ import annotations

from typing import NamedTuple

from room2dgs.tools.roofline.devices import ATOMIC_BYTES, Device

WARP = 32
# of the bound: nothing keeps every unit busy. Stated, not measured; both rasterizers get the same.
REACHED = {
    "instructions": 0.6,
    "special functions": 0.6,
    "shared memory": 0.6,
    "float64": 0.6,
    "L2": 0.7,
    "atomics": 0.5,
    "memory": 0.8,
}
LAUNCH_S = 3e-6


class Cost(NamedTuple):
    """Per item. `warp` costs are of a whole warp at once; all else of one thread or one item.

    Attributes:
        flops: floating operations of a lane, an fma for two; for the table alone.
        instructions: all that a warp starts.
        fp64: of these those in double.
        mufu: reciprocals, roots, exponentials.
        mio: loads and stores of shared memory, loads of the first-level cache, shuffles.
        dram: bytes that must come from or go to the device's memory.
        l2: bytes through the second-level cache, `dram` not among them.
        atomics: on global memory.
    """

    flops: float = 0
    instructions: float = 0
    fp64: float = 0
    mufu: float = 0
    mio: float = 0
    dram: float = 0
    l2: float = 0
    atomics: float = 0

    def __add__(self, other: Cost) -> Cost:  # type: ignore[override]
        return Cost(*(a + b for a, b in zip(self, other, strict=True)))

    def times(self, factor: float) -> Cost:
        """So many of it."""
        return Cost(*(a * factor for a in self))


class Kernel(NamedTuple):
    """One launch, or a few that belong together.

    Attributes:
        name: for the table.
        backward: it belongs to the backward pass.
        parts: what of `Counts` -> its cost for each; of a thread where it goes over surfels, entries or pixels, of a
            whole warp where it goes over warp pairs.
        launches: kernels started.
    """

    name: str
    backward: bool
    parts: dict[str, Cost]
    launches: int = 1


def total(kernel: Kernel, counts: NamedTuple) -> Cost:
    """Of a view, instructions by warps."""
    summed = Cost()
    for unit, cost in kernel.parts.items():
        pairs = unit.endswith("warps")
        lanes = 1 if pairs else WARP
        by_warp = cost._replace(
            flops=cost.flops * (WARP if pairs else 1), instructions=cost.instructions / lanes,
            fp64=cost.fp64 / lanes, mufu=cost.mufu / lanes, mio=cost.mio / lanes,
        )  # fmt: skip
        summed += by_warp.times(getattr(counts, unit))
    return summed


def seconds(kernel: Kernel, counts: NamedTuple, device: Device) -> dict[str, float]:
    """Of each resource alone, all of it used: the largest is the bound."""
    work = total(kernel, counts)
    clocks = device.sms * device.clock_hz
    return {
        "instructions": work.instructions / (device.issue * clocks),
        "special functions": work.mufu / (device.mufu_lanes / WARP * clocks),
        "shared memory": work.mio / (device.mio_lanes / WARP * clocks),
        "float64": work.fp64 / (device.fp64_lanes / WARP * clocks),
        "L2": (work.l2 + work.dram) / device.l2,
        "atomics": work.atomics * ATOMIC_BYTES / device.l2,
        "memory": work.dram / device.dram,
    }


def expected(kernel: Kernel, counts: NamedTuple, device: Device) -> tuple[float, float, str]:
    """(bound, expected) in seconds, and what binds."""
    each = seconds(kernel, counts, device)
    name = max(each, key=lambda key: each[key] / REACHED[key])
    return max(each.values()), each[name] / REACHED[name] + kernel.launches * LAUNCH_S, name
