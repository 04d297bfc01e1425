"""How large a picture may be while a camera moves: as large as the wanted rate allows."""

from __future__ import annotations

LEAST, MOST = 80, 1920  # pixels across
STEP = 1.25  # a picture becomes at most so much wider or narrower at once: no flicker
WEIGHT = 0.3  # of the newest measurement


class Pace:
    """Widths of pictures that take about 1 / fps each.

    Time is taken to be in proportion to the number of pixels: near enough, since every picture is measured.

    Attributes:
        fps: wanted.
    """

    def __init__(self, fps: float) -> None:
        self.fps = fps
        self._seconds_per_pixel: float | None = None
        self._width = 320.0

    def size(self, aspect: float, widest: int) -> tuple[int, int]:
        """(width, height) of the next picture.

        Args:
            aspect: width over height.
            widest: what the window has room for.
        """
        if self._seconds_per_pixel:
            wanted = (aspect / (self.fps * self._seconds_per_pixel)) ** 0.5
            self._width = min(max(wanted, self._width / STEP), self._width * STEP)
        self._width = min(max(self._width, LEAST), MOST)
        width = max(1, min(round(self._width), max(widest, LEAST)))
        return width, max(1, round(width / aspect))

    def took(self, size: tuple[int, int], seconds: float) -> None:
        """A picture of that size took so long."""
        measured = seconds / (size[0] * size[1])
        before = self._seconds_per_pixel
        self._seconds_per_pixel = measured if before is None else (1 - WEIGHT) * before + WEIGHT * measured
