"""Photos as all of them would be with one exposure and one white balance."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

WHITE = 255  # a level that says: at least so bright
NEARLY = 248  # levels from here on go over to white, so that what is clipped has no edge

RGBGains = tuple[float, float, float]


def levelled(photo: np.ndarray, gains: RGBGains) -> np.ndarray:
    """(H, W, 3) uint8: levels divided by the photo's gains; white stays white, since nobody knows how bright it is.

    Args:
        photo: (H, W, 3) uint8.
        gains: of red, green and blue, above 0.
    """
    result = np.empty_like(photo)
    for channel, gain in enumerate(gains):
        result[..., channel] = _table(gain)[photo[..., channel]]
    return result


@lru_cache(maxsize=4096)
def _table(gain: float) -> np.ndarray:
    """(256,) uint8."""
    level = np.arange(256.0)
    divided = level / gain
    share = np.clip((level - NEARLY) / (WHITE - NEARLY), 0, 1)
    return np.round(np.clip(divided + share * (WHITE - divided), 0, WHITE)).astype(np.uint8)
