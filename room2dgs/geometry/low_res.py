"""The size at which depth is sampled, compared and solved: about 160 columns, whatever the photos have."""

from __future__ import annotations

LOW_RES_COLUMNS = 160


def low_res_width(width: int) -> int:
    """Columns of a photo's low-resolution image: 160, or the photo's own if it has fewer."""
    return min(LOW_RES_COLUMNS, width)


def low_res_step(width: int) -> int:
    """Every how many columns and rows of a map are used, so that 160 to 319 remain; 1 for narrower maps."""
    return max(1, width // LOW_RES_COLUMNS)
