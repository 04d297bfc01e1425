"""A decoder with its optimiser: what training changes and a checkpoint holds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from torch.optim import Adam

from room2dgs.config import Config
from room2dgs.scene.scene import PointCloud, Scene
from room2dgs.seeds.decoder import Decoder
from room2dgs.seeds.explicit import ExplicitDecoder, explicit_decoder
from room2dgs.seeds.seeds import seed_points
from room2dgs.seeds.spawn import spawn
from room2dgs.splat.types import Surfels
from room2dgs.train.checkpoint import Checkpoint
from room2dgs.train.optimiser import adam_state, load_adam_state, make_adam


@dataclass
class Model:
    """Decoder and optimiser after `iteration` iterations."""

    decoder: Decoder
    adam: Adam
    iteration: int = 0

    @property
    def seeds(self) -> int:
        """Number of seeds."""
        return len(self.decoder.fixed()["positions"])

    @property
    def surfel_count(self) -> int:
        """Number of surfels."""
        return self.decoder.count()

    def surfels(self, active_sh_degree: int) -> Surfels:
        """Activated, differentiable."""
        return Surfels(*self.decoder.surfels(active_sh_degree))


def new_model(scene: Scene, points: PointCloud, config: Config) -> Model:
    """Seeds from points, surfels from seeds.

    Raises:
        InputError: no points, or points out of range.
    """
    centres = np.stack([frame.camera.centre for frame in scene.train])
    seeds = seed_points(points.xyz, points.rgb, centres, config.seeds)
    spawned = spawn(seeds, config.seeds.per_seed, config.seeds.opacity, config.train.seed)
    decoder = explicit_decoder(spawned, config.render.sh_degree)
    return Model(decoder, make_adam(decoder.parameters()))


def restored_model(state: Checkpoint) -> Model:
    """The model that `checkpoint_of` was given."""
    decoder = ExplicitDecoder(**state.fixed, **state.parameters)
    adam = make_adam(decoder.parameters())
    load_adam_state(adam, state.adam)
    return Model(decoder, adam, state.iteration)


def checkpoint_of(model: Model, fingerprint: dict[str, Any], seconds: dict[str, float]) -> Checkpoint:
    """The model's state, sharing its tensors."""
    return Checkpoint(
        model.iteration,
        model.decoder.parameters(),
        model.decoder.fixed(),
        adam_state(model.adam),
        fingerprint,
        dict(seconds),
    )
