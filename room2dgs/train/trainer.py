"""The trainer: the state of a run and its loop, and the hooks by which everything else takes part in it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path

import torch
from torch import Tensor

from room2dgs.captures.point_cloud import PointCloud
from room2dgs.captures.scene import Scene
from room2dgs.captures.view_maps import ViewMaps
from room2dgs.config import Config
from room2dgs.errors import InputError, first_line
from room2dgs.files import remove_leftovers
from room2dgs.kernels.builds import BLOCK_BUILDS
from room2dgs.logs import Log
from room2dgs.primitives.primitive import Splats, mapped
from room2dgs.train import checkpoint
from room2dgs.train.checkpoint import Checkpoint
from room2dgs.train.device import CPU, DeviceCache
from room2dgs.train.fingerprint import check_same, fingerprint
from room2dgs.train.model import checkpoint_of, model_on, new_model, restored_model
from room2dgs.train.neighbour_views import Pair
from room2dgs.train.progress import StageClock
from room2dgs.train.schedule import image_fraction, view_index
from room2dgs.train.step import Step, current_splats, descend, forward_backward
from room2dgs.train.strategies.strategy import Adjustment
from room2dgs.train.views import View, Views


@dataclass
class Iteration:
    """One iteration: what goes into it, which hooks may change before it is rendered, and what came of it.

    Attributes:
        number: from 0.
        view_index: of the training views.
        view: that is rendered and compared. A pose that wants a gradient gets it.
        pair: the view with a neighbour, for the multi-view terms; None: they do not act.
        screen_gradients: whether `step` is to hold opacities and gradients of projected centres; they cost time.
        step: what rendering gave; there from `after_backward` on.
        adjustment: of the seeds; None where there was none.
        held_out_psnr_db: of the held-out views; None where they were not rendered.
    """

    number: int
    view_index: int
    view: View
    pair: Pair | None = None
    screen_gradients: bool = False
    step: Step = field(init=False, repr=False)
    adjustment: Adjustment | None = None
    held_out_psnr_db: float | None = None

    @property
    def done(self) -> int:
        """Iterations done after this one."""
        return self.number + 1


class Hook:
    """Takes part in a run; every method may be left out. Hooks are called one after the other, in their order.

    A viewer shows `trainer.surfels()` in `after_step`; a refinement of poses replaces `iteration.view` by one whose
    pose wants a gradient, takes its own step in `after_backward` and keeps what it learnt by `state` and `load`.
    What a hook draws must follow from (train.seed, iteration), and what it carries from one iteration to the next
    must be in `state`: then a run that was killed and resumed gives the same bits.

    For example, a hook that ends a run once the loss is low enough, ten times in a row:

        class StopWhenGood(Hook):
            def __init__(self, loss: float) -> None:
                self.loss, self.times = loss, 0

            def after_step(self, trainer: Trainer, iteration: Iteration) -> None:
                self.times = self.times + 1 if iteration.step.losses["loss"] < self.loss else 0
                trainer.stop_requested = self.times >= 10

            def state(self) -> dict[str, Tensor]:
                return {"times": torch.tensor(self.times)}

            def load(self, trainer: Trainer, state: dict[str, Tensor]) -> None:
                self.times = int(state["times"])

        train(scene, points, config, out, hooks=[StopWhenGood(0.02)])
    """

    @property
    def name(self) -> str:
        """Under which its state stands in a checkpoint; no two hooks of a run have the same."""
        return type(self).__name__

    def on_start(self, trainer: Trainer) -> None:
        """Before the first iteration, and before `load`; `trainer.model` is there."""

    def load(self, trainer: Trainer, state: dict[str, Tensor]) -> None:
        """The way back from `state`, in a resumed run whose checkpoint has any for this hook."""

    def before_iteration(self, trainer: Trainer, iteration: Iteration) -> None:
        """Before the view is rendered."""

    def after_backward(self, trainer: Trainer, iteration: Iteration) -> None:
        """The gradients are there, the parameters are as they were."""

    def after_step(self, trainer: Trainer, iteration: Iteration) -> None:
        """The parameters have changed and `trainer.model.iteration` counts this iteration."""

    def state(self) -> dict[str, Tensor]:
        """What the next iteration depends on, for a checkpoint."""
        return {}

    def on_end(self, trainer: Trainer) -> None:
        """After the last iteration, and after an exception, if `on_start` ended; the last hook first."""


class Trainer:
    """A run: its input, its state and its loop.

    Attributes:
        scene, config, out, log: as `train` has them.
        hooks: in their order.
        device: where surfels, photos, maps and the optimiser are.
        views: the training views.
        fingerprint: the settings that decide the result.
        model: surfels and optimiser after `model.iteration` iterations.
        clock: time by stage, earlier runs included.
        stop_requested: a hook sets it to end the run after this iteration, with a checkpoint and a result.

    Raises:
        InputError: no usable points, or a resumed run whose settings, views or priors differ from the first one's.
        ValueError: two hooks of one name.
    """

    def __init__(
        self,
        scene: Scene,
        points: PointCloud,
        config: Config,
        out: Path,
        log: Log,
        priors: Mapping[str, ViewMaps] | None = None,
        hooks: Sequence[Hook] = (),
        device: torch.device = CPU,
    ) -> None:
        if len({hook.name for hook in hooks}) < len(hooks):
            raise ValueError(f"hooks of the same name: {', '.join(sorted(hook.name for hook in hooks))}")
        self.scene, self.config, self.out, self.log, self.hooks = scene, config, out, log, tuple(hooks)
        self.device = device
        on_device = DeviceCache(device, config.memory.gpu_mb) if device.type in BLOCK_BUILDS else None
        self.views = Views(scene.train, priors, scene.cache, on_device)
        self.fingerprint = fingerprint(config, scene, priors)
        self.clock = StageClock()
        self.stop_requested = False
        self._resumed_state: dict[str, Tensor] = {}
        self._extent_m = scene.extent  # goes over all cameras
        remove_leftovers(checkpoint.folder_of(out), owned=True)
        resumed = checkpoint.latest(out, log) if config.resume else None
        if resumed:
            self._resume(resumed)
            return
        if config.resume:
            log(f"no whole checkpoint in {checkpoint.folder_of(out)}; starting from the beginning")
        self.model = model_on(new_model(scene, points, config, priors), device)
        log(
            f"{len(points)} points, {self.model.seeds} seeds, {self.model.count} {self.model.primitive.called}, "
            f"{len(scene.train)} training views"
        )

    @property
    def finished(self) -> bool:
        """Was this the last iteration?"""
        return self.stop_requested or self.model.iteration >= self.config.train.iterations

    def run(self) -> None:
        """Iterate to the end.

        Raises:
            InputError: a photo that cannot be decoded, a full disk.
        """
        with ExitStack() as ends:
            for hook in self.hooks:
                hook.on_start(self)
                ends.callback(hook.on_end, self)
                prefix = f"{hook.name}/"
                state = {k.removeprefix(prefix): v for k, v in self._resumed_state.items() if k.startswith(prefix)}
                if state:
                    self._load(hook, state)
            while not self.finished:
                self._iterate()

    def _load(self, hook: Hook, state: dict[str, Tensor]) -> None:
        """Raises InputError where the checkpoint's state is none of this hook's."""
        try:
            hook.load(self, state)
        except (LookupError, TypeError, ValueError, RuntimeError) as error:
            raise InputError(
                f"the checkpoint of iteration {self.model.iteration} does not fit {hook.name} ({first_line(error)}); "
                "delete it and go on with another"
            ) from error

    def surfels(self) -> Splats:
        """As the last iteration saw them, activated, without gradients, on the CPU."""
        return mapped(current_splats(self.model, self.config.render), Tensor.cpu)

    def checkpoint(self) -> Checkpoint:
        """The whole state, sharing its tensors."""
        states = {hook.name: hook.state() for hook in self.hooks}
        extra = {f"{owner}/{name}": value for owner, state in states.items() for name, value in state.items()}
        return checkpoint_of(self.model, self.fingerprint, self.clock.seconds, extra)

    def _iterate(self) -> None:
        number, settings = self.model.iteration, self.config.train
        self.clock.start()
        index = view_index(number, len(self.views), settings.seed)
        view = self.views.at(index, image_fraction(number, settings, self.views.widest))
        iteration = Iteration(number, index, view)
        for hook in self.hooks:
            hook.before_iteration(self, iteration)
        iteration.step = forward_backward(
            self.model,
            iteration.view,
            self.config,
            self.clock,
            screen_gradients=iteration.screen_gradients,
            pair=iteration.pair,
        )
        for hook in self.hooks:
            hook.after_backward(self, iteration)
        descend(self.model, self.config, self._extent_m)
        self.clock.lap("optimiser")
        for hook in self.hooks:
            hook.after_step(self, iteration)

    def _resume(self, state: Checkpoint) -> None:
        check_same(state.fingerprint, self.fingerprint, self.out)
        self.log(f"resuming after iteration {state.iteration} of {self.config.train.iterations}")
        self.model = model_on(restored_model(state, self.config), self.device)
        self.clock = StageClock(state.seconds)
        self._resumed_state = state.extra
