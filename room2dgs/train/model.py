"""A decoder with its optimiser, Adam with one group a parameter: what training changes and a checkpoint holds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.optim import Adam

from room2dgs.captures.point_cloud import PointCloud
from room2dgs.captures.scene import Scene
from room2dgs.captures.view_maps import ViewMaps
from room2dgs.config import Config
from room2dgs.primitives.primitive import Primitive, Splats
from room2dgs.primitives.registry import new_primitive
from room2dgs.seeds.continued import continued
from room2dgs.seeds.decoders.decoder import Decoder
from room2dgs.seeds.decoders.registry import new_decoder, restored_decoder
from room2dgs.seeds.depth_seeds import away_from, prior_surface
from room2dgs.seeds.seeds import joined, seed_points, surface_seeds
from room2dgs.seeds.spawn import first_opacity, spawn
from room2dgs.train.checkpoint import Checkpoint
from room2dgs.train.state_check import check_state

EPSILON = 1e-15  # of Adam, 2DGS: gradients of a mean over pixels are tiny


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
    def count(self) -> int:
        """Number of primitives."""
        return self.decoder.count()

    @property
    def primitive(self) -> Primitive:
        """What they are."""
        return self.decoder.primitive

    def splats(self, active_sh_degree: int) -> Splats:
        """The primitives, activated, differentiable."""
        return self.decoder.splats(active_sh_degree)


def new_model(scene: Scene, points: PointCloud, config: Config, priors: Mapping[str, ViewMaps] | None = None) -> Model:
    """Seeds from points and, with seeds.init=sfm+depth, from depth priors; primitives from seeds.

    Raises:
        InputError: no points, or points out of range.
    """
    centres = np.stack([frame.camera.centre for frame in scene.train])
    surface = None
    if config.seeds.init == "sfm+depth" and priors:
        surface = prior_surface(scene.train, priors, config.seeds.depth_voxel_m)
        cameras = [frame.camera for frame in scene.train]
        surface = continued(surface, cameras, config.seeds.depth_voxel_m, config.seeds.beyond_m)
    if surface is not None and len(surface.xyz) and not len(points):
        seeds = surface_seeds(surface, config.seeds)  # photos that tell no depth have no points
    else:
        seeds = seed_points(points.xyz, points.rgb, centres, config.seeds, config.train.seed)
        if surface is not None:
            surface = away_from(surface, points.xyz, config.seeds.depth_voxel_m)
            seeds = joined(seeds, surface_seeds(surface, config.seeds))
    spawned = spawn(seeds, config.seeds.per_seed, first_opacity(config), config.train.seed)
    primitive, degree = new_primitive(config), config.render.sh_degree
    decoder = new_decoder(spawned, primitive, config.seeds, degree, config.train.seed)
    return Model(decoder, make_adam(decoder.parameters()))


def restored_model(state: Checkpoint, config: Config) -> Model:
    """The model that `checkpoint_of` was given.

    Raises:
        InputError: the checkpoint's tensors are not those that these settings make.
    """
    check_state(state, config)
    decoder = restored_decoder(new_primitive(config), config.seeds, state.fixed, state.parameters)
    adam = make_adam(decoder.parameters())
    load_adam_state(adam, state.adam)
    return Model(decoder, adam, state.iteration)


def model_on(model: Model, device: torch.device) -> Model:
    """The model with its optimiser on a device; the same one where it is there."""

    def there(tensors: dict[str, Tensor]) -> dict[str, Tensor]:
        return {name: value.detach().to(device) for name, value in tensors.items()}

    fixed = model.decoder.fixed()
    if fixed["positions"].device == device:
        return model
    decoder = model.decoder.with_tensors(there(fixed), there(model.decoder.parameters()))
    adam = make_adam(decoder.parameters())
    load_adam_state(adam, there(adam_state(model.adam)))
    return Model(decoder, adam, model.iteration)


def checkpoint_of(
    model: Model, fingerprint: dict[str, Any], seconds: dict[str, float], extra: dict[str, Tensor]
) -> Checkpoint:
    """The model's state, sharing its tensors, and what else belongs to the run's (`Checkpoint.extra`)."""
    return Checkpoint(
        model.iteration,
        model.decoder.parameters(),
        model.decoder.fixed(),
        adam_state(model.adam),
        fingerprint,
        dict(seconds),
        extra,
    )


def make_adam(parameters: dict[str, Tensor]) -> Adam:
    """Adam whose groups carry the parameters' names; rates are 0 until `set_rates`."""
    groups = [{"params": [value], "name": name} for name, value in parameters.items()]
    return Adam(groups, lr=0.0, eps=EPSILON, fused=True)


def set_rates(adam: Adam, rates: dict[str, float]) -> None:
    """Learning rate of each group by name."""
    for group in adam.param_groups:
        group["lr"] = rates[group["name"]]


def adam_state(adam: Adam) -> dict[str, Tensor]:
    """Moments and step counts: "exp_avg/offsets", ...; a parameter that never had a gradient has none."""
    return {
        f"{key}/{group['name']}": value
        for group in adam.param_groups
        for key, value in adam.state.get(group["params"][0], {}).items()
    }


def load_adam_state(adam: Adam, tensors: dict[str, Tensor]) -> None:
    """The way back from `adam_state`."""
    for group in adam.param_groups:
        state = {
            key: tensors[f"{key}/{group['name']}"].clone()
            for key in ("step", "exp_avg", "exp_avg_sq")
            if f"{key}/{group['name']}" in tensors
        }
        if state:
            adam.state[group["params"][0]] = state
