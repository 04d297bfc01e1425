"""A length and how sure it is, by cause."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Length:
    """A measured length; deviations are one standard deviation, metres.

    Attributes:
        value: metres, or units of the capture where its scale is unknown.
        surface_m: by the surfaces that it lies between.
        fit_m: by how well planes or edges were found on them; 0 for single points.
        scale_m: by the scale that all lengths of the run share.
        rests_on: what it was measured between, in words.
    """

    value: float
    surface_m: float
    fit_m: float
    scale_m: float
    rests_on: str

    @property
    def sigma(self) -> float:
        """All causes together; they are independent of each other."""
        return float(np.sqrt(self.surface_m**2 + self.fit_m**2 + self.scale_m**2))

    def as_dict(self, unit: str) -> dict[str, Any]:
        """Plain values.

        Args:
            unit: "m" or "units".
        """
        return {
            "value": self.value,
            "sigma": self.sigma,
            "unit": unit,
            "parts": {"surface": self.surface_m, "fit": self.fit_m, "scale": self.scale_m},
            "rests_on": self.rests_on,
        }

    def text(self, unit: str) -> str:
        """ "4.213 m ± 6 mm", or in units with as many digits as the deviation allows."""
        return with_sigma(self.value, self.sigma, unit)


def with_sigma(value: float, sigma: float, unit: str) -> str:
    """A value with its deviation: millimetres below 10 cm, metres above."""
    if unit != "m":
        return f"{value:.4g} ± {sigma:.2g} {unit}"
    if sigma < 0.1:
        return f"{value:.3f} m ± {max(1, round(sigma * 1000))} mm"
    return f"{value:.2f} m ± {sigma:.2f} m"
