"""How sure the scale of a run is: what its metres come from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

# Of poses that somebody else gave as metres: trackers of phones and depth cameras are off by this much.
GIVEN_SIGMA = 0.005
LENGTH_SIGMA = 0.01  # of a known length that nobody said the error of
KNOWN_LENGTH = "known length"


@dataclass(frozen=True)
class ScaleTrust:
    """What all lengths of a run share.

    Attributes:
        known: lengths are metres; False: units of the capture.
        sigma: relative standard deviation; 0 where nothing is known of it.
        words: where it comes from.
    """

    known: bool
    sigma: float
    words: str

    @property
    def unit(self) -> str:
        return "m" if self.known else "units"


def scale_trust(
    metric: bool, noted: Mapping[str, Any] | None, prepared: Mapping[str, Any] | None, sigma: float | None = None
) -> ScaleTrust:
    """Of a run.

    Args:
        metric: whether the capture, or the run by an estimate of its own, is in metres.
        noted: `unit` of metrics.json: "metres" of one unit, "source", "sigma".
        prepared: `scale` of the capture's prepare.json; None: `room2dgs prepare` did not make it.
        sigma: what is known of poses that were given as metres; None: `GIVEN_SIGMA`.
    """
    noted = noted or {}
    source, metres = str(noted.get("source", "")), float(noted.get("metres") or 1.0)
    if source == KNOWN_LENGTH:
        own = float(noted.get("sigma") or 0.0)
        return ScaleTrust(True, own, f"a known length, ± {own:.2%}")
    if source == "depth prior":
        own = float(noted.get("sigma") or 0.0)
        return ScaleTrust(True, own, f"estimated by the depth network, ± {own:.0%}: set it with a known length")
    if prepared:
        return _prepared(prepared)
    if source == "scene.unit":
        own = 0.0 if sigma is None else sigma
        return ScaleTrust(True, own, f"scene.unit={metres:g}, ± {own:.2%}")
    if metric:
        own = GIVEN_SIGMA if sigma is None else sigma
        assumed = " (assumed)" if sigma is None else ""
        return ScaleTrust(True, own, f"poses given as metres, ± {own:.2%}{assumed}")
    return ScaleTrust(False, 0.0, "unknown: lengths are units of the capture's poses")


def _prepared(prepared: Mapping[str, Any]) -> ScaleTrust:
    source = str(prepared.get("source", ""))
    sigma = prepared.get("sigma")
    own = float(sigma) if isinstance(sigma, int | float) else LENGTH_SIGMA
    assumed = "" if isinstance(sigma, int | float) else " (assumed)"
    words = {
        "sensor": "a depth sensor",
        "length": f"prepare.length ({prepared.get('words', '')})",
        "network": "the depth network: set it with a known length",
    }.get(source, source)
    return ScaleTrust(True, own, f"{words}, ± {own:.2%}{assumed}")
