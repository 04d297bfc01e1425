"""How far a run is as a whole, and how long it will still take: stages weighed by what this capture costs."""

from __future__ import annotations

import os
import re
import time
from collections.abc import Callable, Mapping
from pathlib import Path

from room2dgs.captures.listing import PHOTO_SUFFIXES
from room2dgs.config import Config

# stage -> what is done there, in the order of a run
STAGES = {
    "prepare": "finding where the photos were taken",
    "read": "reading the photos",
    "poses": "checking the poses",
    "points": "finding points",
    "stereo": "comparing photos for depth",
    "priors": "estimating depth and normals",
    "exposure": "levelling the exposure",
    "train": "training",
    "mesh": "making the mesh",
    "texture": "putting the photos on the mesh",
    "export": "writing splats",
    "render": "drawing held-out photos",
    "eval": "measuring the mesh",
    "verdict": "judging the run",
    "report": "writing the page",
}
ASIDE_S = 10.0  # of expected work that counts as done as expected: the first seconds say little of the machine
BEGUN = 0.02  # share of a stage from which on its own pace counts
NEARLY = 0.98
LATE = 0.1  # of a stage's expected time that is always thought left of it
PREPARE_S, USUAL_PHOTOS, USUAL_MP = 180.0, 120, 0.3  # before anything is known of a capture
DEEPEST = 2  # folders below the capture's
TOLD = re.compile(r"^iteration (\d+)/(\d+):|: (\d+) of (\d+) (?:photos|views)$")


def expected_seconds(config: Config, photos: int, megapixels: float) -> dict[str, float]:
    """Seconds of each stage of a run on two cores, roughly; `Progress` corrects them while it goes.

    Args:
        photos: that the run uses.
        megapixels: of a photo at the size that it works at.
    """
    small = min(megapixels, 1.0)
    trained = config.mesh.of_surfels
    found = {
        "read": 0.3 + 0.01 * photos,
        "poses": photos * (0.2 + 0.6 * small),
        "points": photos * 0.05,
        "stereo": photos * 4.0 * small,
        "priors": photos * (0.1 + 2.0 * small),
        "exposure": 1.0 + 0.005 * photos,
        "train": config.train.iterations * (0.01 + 0.3 * small),
        "mesh": 6.0 + photos * (0.05 + 0.8 * small),
        "texture": 8.0 + photos * (0.1 + 0.3 * small) if config.export.textured else 0.0,
        "export": 0.5,
        "render": 0.1 * photos * small,
        "eval": 8.0 + photos * (0.05 + 0.5 * small),
        "verdict": 0.5 + 0.01 * photos,
        "report": (4.0 + 0.05 * photos) if config.report.enabled else 0.0,
    }
    of_training = ("train", "export", "render")
    return {stage: 0.0 if stage in of_training and not trained else seconds for stage, seconds in found.items()}


def listed_photos(config: Config) -> int:
    """How many photos a capture seems to have, before it is read: those of the folder with most of them."""
    root = Path(config.scene.path)
    most = 0
    for folder, inner, names in os.walk(root):
        most = max(most, sum(Path(name).suffix.lower() in PHOTO_SUFFIXES for name in names))
        if len(Path(folder).relative_to(root).parts) >= DEEPEST:
            inner.clear()
    return min(most or USUAL_PHOTOS, config.scene.frames or most or USUAL_PHOTOS)


class Progress:
    """Share of the work that is done, and seconds left. It never goes back.

    Attributes:
        stage: that is at work; "" before the first.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self.stage = ""
        self._clock = clock
        self._expected: Mapping[str, float] = {}
        self._took: dict[str, float] = {}
        self._since = self._start = clock()
        self._part: float | None = None  # of the stage
        self._share = 0.0

    def expect(self, seconds: Mapping[str, float]) -> None:
        """What the stages will take (`expected_seconds`); said again when more is known."""
        self._expected = dict(seconds)

    def begin(self, stage: str) -> None:
        """A stage begins, so that the one before is done."""
        now = self._clock()
        if self.stage:
            self._took[self.stage] = self._took.get(self.stage, 0.0) + now - self._since
        self.stage, self._since, self._part = stage, now, None

    def tell(self, line: str) -> None:
        """A line of the log, which may say how far the stage is."""
        found = TOLD.search(line)
        if found:
            done, count = (int(one) for one in found.groups() if one)
            self._part = min(done / max(count, 1), NEARLY)

    @property
    def what(self) -> str:
        """What is being done, in words."""
        return STAGES.get(self.stage, self.stage)

    def left_s(self) -> float | None:
        """Seconds that the rest will take; None: nothing is known yet."""
        if not self._expected:
            return None
        order = list(STAGES)
        later = order[order.index(self.stage) + 1 :] if self.stage in STAGES else order
        ahead = sum(self._expected.get(stage, 0.0) for stage in later if stage not in self._took)
        return self._current_left() + ahead * self._pace()

    def share(self) -> float:
        """Of the whole, 0..1."""
        left = self.left_s()
        if left is not None:
            past = self._clock() - self._start
            self._share = max(self._share, past / max(past + left, 1e-9))
        return self._share

    def _current_left(self) -> float:
        elapsed, wanted = self._clock() - self._since, self._expected.get(self.stage, 0.0) * self._pace()
        if self._part is not None and self._part > BEGUN:
            return elapsed * (1 - self._part) / self._part
        return max(wanted - elapsed, LATE * wanted)

    def _pace(self) -> float:
        """Of this machine: seconds for one that was expected, over the stages that are done."""
        done = [stage for stage in self._took if stage in self._expected]
        wanted = sum(self._expected[stage] for stage in done)
        return (sum(self._took[stage] for stage in done) + ASIDE_S) / (wanted + ASIDE_S)
