"""Small corrections of each view's pose that are learnt beside the surfels."""

from __future__ import annotations

import torch
from torch import Tensor

from room2dgs.train.per_view_adam import PerViewAdam
from room2dgs.train.schedule import correction_share
from room2dgs.train.trainer import Hook, Iteration, Trainer
from room2dgs.train.views import View


class PoseCorrections(Hook):
    """Turns each training camera about its centre and shifts it, by the rasterizer's pose gradients.

    A correction is (omega, t), in the world frame: world_from_cam becomes exp([omega]) R with centre c + t. Over all
    views their means and the part of t that swells the whole path are taken out, so that the world stays where it is.
    The neighbours of the multi-view terms are corrected, too; held-out views are not, nor those that are meshed.
    """

    name = "pose_corrections"

    def on_start(self, trainer: Trainer) -> None:
        cameras = [frame.camera for frame in trainer.views.frames]
        centre = torch.stack([torch.from_numpy(camera.centre) for camera in cameras])
        self._from_mean = (centre - centre.mean(dim=0)).to(trainer.device)
        self._number = {frame.name: index for index, frame in enumerate(trainer.views.frames)}
        rates = trainer.config.train.rates
        self._rates = torch.tensor([rates.pose_rotation] * 3 + [rates.pose_center] * 3, dtype=torch.float64)
        self._rates = self._rates.to(trainer.device)
        self._rows = PerViewAdam(len(cameras), 6, trainer.device)
        self._leaf: Tensor | None = None

    def before_iteration(self, trainer: Trainer, iteration: Iteration) -> None:
        self._leaf = self._rows.values[iteration.view_index].clone().requires_grad_()
        iteration.view = corrected(iteration.view, self._leaf)
        if iteration.pair:
            other = iteration.pair.neighbour
            row = self._rows.values[self._number[other.name]]
            iteration.pair = iteration.pair._replace(neighbour=corrected(other, row))

    def after_backward(self, trainer: Trainer, iteration: Iteration) -> None:
        share = correction_share(iteration.number, trainer.config.train.iterations)
        if self._leaf is None or self._leaf.grad is None or share == 0:
            return
        self._rows.step(iteration.view_index, self._leaf.grad, share * self._rates)
        self._rows.values = without_world_motion(self._rows.values, self._from_mean)

    def state(self) -> dict[str, Tensor]:
        return self._rows.state()

    def load(self, trainer: Trainer, state: dict[str, Tensor]) -> None:
        self._rows.load(state)

    def on_end(self, trainer: Trainer) -> None:
        turns, shifts = self._rows.values[:, :3].norm(dim=1), self._rows.values[:, 3:].norm(dim=1)
        trainer.log(
            f"pose corrections: {100 * shifts.median().item():.2f} cm, "
            f"{turns.rad2deg().median().item():.3f} deg (median), {100 * shifts.max().item():.2f} cm, "
            f"{turns.rad2deg().max().item():.3f} deg (largest)"
        )


def corrected(view: View, correction: Tensor) -> View:
    """The view with its camera turned about its centre and shifted; differentiable in the correction.

    Args:
        correction: (6,) float64: rotation vector and shift, radians and metres, world frame.
    """
    given = view.cam_from_world.double()
    x, y, z = correction[:3]
    none = torch.zeros_like(x)
    skew = torch.stack([none, -z, y, z, none, -x, -y, x, none]).reshape(3, 3)
    rotation = given[:3, :3] @ torch.linalg.matrix_exp(skew).T
    centre = correction[3:] - given[:3, :3].T @ given[:3, 3]
    pose = torch.cat([torch.cat([rotation, -(rotation @ centre)[:, None]], dim=1), given[3:]])
    return view._replace(cam_from_world=pose.to(view.cam_from_world.dtype))


def without_world_motion(corrections: Tensor, from_mean: Tensor) -> Tensor:
    """The corrections without what moves the world as a whole: mean turn, mean shift, and change of scale.

    Args:
        corrections: (V, 6) as `corrected` takes them.
        from_mean: (V, 3) centres less their mean, metres.
    """
    corrections = corrections - corrections.mean(dim=0)
    turn, shift = corrections[:, :3], corrections[:, 3:]
    spread = from_mean.square().sum()
    swelling = torch.where(spread > 0, (shift * from_mean).sum() / spread, 0.0)
    shift = shift - swelling * from_mean
    return torch.cat([turn, shift], dim=1)
