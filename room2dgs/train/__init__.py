"""Training: the loop, its schedules, optimiser, checkpoints and progress."""

from room2dgs.train.loop import TrainResult, train
from room2dgs.train.surfel_file import load_surfels, save_surfels

__all__ = ["TrainResult", "load_surfels", "save_surfels", "train"]
