"""A run while it trains, in a browser: `train.viewer=true`."""

from __future__ import annotations

import time

import numpy as np

from room2dgs.geometry.up_axis import up_axis
from room2dgs.train.trainer import Hook, Iteration, Trainer
from room2dgs.viewer.server import Viewer, found_viser

EVERY_S = 1.0  # surfels are copied no more often, and only while somebody looks
FPS = 5.0  # pictures take time from the training


class ShowTraining(Hook):
    """Serves the surfels as they are; nothing that it does changes the run's result."""

    def __init__(self) -> None:
        found_viser()  # before hours of work, not after them

    def on_start(self, trainer: Trainer) -> None:
        cameras = [frame.camera for frame in trainer.scene.train]
        up, near_m = up_axis(cameras, np.zeros((0, 3))), trainer.config.render.near_m
        self.viewer = Viewer(trainer.surfels(), up, fps=FPS, near_m=near_m)
        self.viewer.look_from(cameras[0])
        self.viewer.start()
        self._shown = time.monotonic()
        # others may read a run's log; the token is for who started it
        trainer.log(f"watch the training at {self.viewer.address}, with the token that the terminal shows")
        print(f"look at {self.viewer.url}", flush=True)

    def after_step(self, trainer: Trainer, iteration: Iteration) -> None:
        now = time.monotonic()
        if self.viewer.watched and now - self._shown >= EVERY_S:
            self._shown = now
            self.viewer.show(trainer.surfels())
            self.viewer.show_message(f"iteration {iteration.done} of {trainer.config.train.iterations}")

    def on_end(self, trainer: Trainer) -> None:
        if hasattr(self, "viewer"):
            self.viewer.stop()
