"""Training: the trainer and its hooks, loss terms, strategies, schedules and checkpoints."""

from room2dgs.train.run import TrainResult, train
from room2dgs.train.surfel_file import load_surfels, save_surfels
from room2dgs.train.trainer import Hook, Iteration, Trainer

__all__ = ["Hook", "Iteration", "TrainResult", "Trainer", "load_surfels", "save_surfels", "train"]
