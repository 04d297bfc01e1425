"""What GPUs can do at most, from their makers' data sheets."""

from __future__ import annotations

from typing import NamedTuple

# a float32 atomic moves one sector of the second-level cache
ATOMIC_BYTES = 32


class Device(NamedTuple):
    """Peak figures.

    Attributes:
        name: as its maker calls it.
        sms: streaming multiprocessors; each starts 4 warp instructions a clock, of 32 lanes.
        clock_hz: boost clock, at which the data sheet's operations count.
        fp64_lanes: double operations a clock and SM.
        dram: bytes a second of the device's memory.
        l2: bytes a second of the second-level cache; no data sheet says it, this is what others measured.
        l2_bytes: its size.
    """

    name: str
    sms: int
    clock_hz: float
    fp64_lanes: int
    dram: float
    l2: float
    l2_bytes: float
    issue: float = 4.0
    mufu_lanes: int = 16
    mio_lanes: int = 32

    @property
    def fp32(self) -> float:
        """Operations a second, an fma for two."""
        return self.sms * 128 * 2 * self.clock_hz


DEVICES = (
    # NVIDIA H100 and H200 Tensor Core GPU data sheets (SXM): 67 TFLOPS float32, 34 float64
    Device("H100 SXM", 132, 1.98e9, 64, 3.35e12, 5.7e12, 50e6),
    Device("H200", 132, 1.98e9, 64, 4.8e12, 5.7e12, 50e6),
    # NVIDIA Ada GPU architecture paper: 82.6 TFLOPS float32, 1/64 of it in float64
    Device("RTX 4090", 128, 2.52e9, 2, 1.008e12, 5.0e12, 72e6),
)
