"""The interface of a primitive, with what all kinds have in common: named parameters, their activation, their files."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple, Protocol, TypeVar

import numpy as np
import torch
from torch import Tensor

from room2dgs.geometry.spherical_harmonics import C0
from room2dgs.primitives.activations import EXP, OPACITY_LOGIT_MAX, ScaleActivation, opacity_logit_of, opacity_of
from room2dgs.primitives.spawned import Spawned
from room2dgs.splat.types import Rendering, Surfels

OFFSETS, ROTATIONS, RAW_SCALES = "offsets", "rotations", "raw_scales"
OPACITY_LOGITS, SH_DC, SH_REST = "opacity_logits", "sh_dc", "sh_rest"
REST_SHARE = 1 / 20  # of the colour's rate, for SH above degree 0 (2DGS)
BASES = -1  # in `Primitive.shapes`: as many as the colour's degree has


class Splats(Protocol):
    """N activated primitives of one kind, as they are rendered: a named tuple such as `splat.Surfels`.

    Attributes:
        centers: (N, 3) metres.
        rotations: (N, 4) quaternions (w, x, y, z) of any norm above 0.
        scales: (N, D) metres, D of the kind.
        opacities: (N,) in (0, 1).
        sh: (N, K, 3) spherical-harmonics coefficients.
    """

    @property
    def centers(self) -> Tensor: ...
    @property
    def rotations(self) -> Tensor: ...
    @property
    def scales(self) -> Tensor: ...
    @property
    def opacities(self) -> Tensor: ...
    @property
    def sh(self) -> Tensor: ...
    def __iter__(self) -> Iterator[Tensor]: ...
    def _asdict(self) -> dict[str, Any]: ...
    @property
    def _replace(self) -> Callable[..., Any]: ...


S = TypeVar("S", bound=Splats)


class Rates(NamedTuple):
    """Adam's learning rates in one iteration; of centres in metres a step."""

    center: float
    rotation: float
    scale: float
    opacity: float
    color: float
    feature: float
    network: float


@dataclass(frozen=True)
class Primitive(ABC):
    """One kind of primitive. A new kind is a subclass in a file beside this one and a line in `registries.primitives`.

    Its learnt parameters are named tensors of shape (S, k, ...): k primitives for each of S rows, which strategies
    copy, drop and add. Their centres are a row's position plus "offsets", which the decoder has.

    Attributes:
        activation: what raw scales mean.
        splats: the named tuple of activated primitives (`Splats`); no other kind has the same.
        parameters: names of the raw parameters, in the order in which they are optimised; SH_REST only above degree 0.
        file_kind: what a file of them says that it holds.
        called: what logs and pages call several of them, one word.
        shapes: of one activated primitive, by field; `BASES` stands for the number of harmonics.
    """

    activation: ScaleActivation = EXP

    splats: ClassVar[Callable[..., Any]]
    parameters: ClassVar[tuple[str, ...]] = (ROTATIONS, RAW_SCALES, OPACITY_LOGITS, SH_DC, SH_REST)
    file_kind: ClassVar[str]
    called: ClassVar[str] = "surfels"
    shapes: ClassVar[Mapping[str, tuple[int, ...]]]

    @abstractmethod
    def render(
        self, splats: Any, K: Tensor, cam_from_world: Tensor, width: int, height: int, **options: Any
    ) -> Rendering:
        """One view; arguments and options are those of `splat.render`, differentiable as it is."""

    @abstractmethod
    def scale_axes(self, splats: Splats) -> Tensor:
        """(N, A, 3) unit, world frame: the directions that it reaches along, in the order of `axis_scales`."""

    @abstractmethod
    def normals(self, splats: Splats) -> Tensor:
        """(N, 3) unit, world frame, on either side: of the surface that each primitive is a piece of."""

    @abstractmethod
    def footprints(self, splats: Splats) -> Tensor:
        """(N,) metres: the scale of a round disc that covers as much of the surface."""

    @abstractmethod
    def three_scales(self, splats: Splats) -> np.ndarray:
        """(N, 3) metres along the columns of the rotation's matrix, as files of 3D Gaussians have them."""

    @abstractmethod
    def as_discs(self, splats: Splats) -> Surfels:
        """Flat discs that cover the same surface, for pages and programs that draw no other kind."""

    def axis_scales(self, splats: Splats) -> Tensor:
        """(N, A) metres along each of `scale_axes`."""
        return splats.scales

    def first_scales(self, spawned: Spawned) -> Tensor:
        """(S, k, D) metres of primitives that start as these discs."""
        return spawned.scales

    def first_parameters(self, spawned: Spawned, sh_rest: int) -> dict[str, Tensor]:
        """Raw parameters that mean the spawned discs, by name.

        Args:
            sh_rest: harmonics above degree 0; they start at zero.
        """
        rows = {
            ROTATIONS: spawned.rotations.clone(),
            RAW_SCALES: self.activation.raw_of(self.first_scales(spawned)),
            OPACITY_LOGITS: opacity_logit_of(spawned.opacities),
            SH_DC: spawned.sh_dc[:, :, None].clone(),
        }
        if sh_rest:
            rows[SH_REST] = torch.zeros(*spawned.opacities.shape, sh_rest, 3, dtype=torch.float32)
        return rows

    def activated(self, centers: Tensor, parameters: Mapping[str, Tensor], active_sh_degree: int) -> Splats:
        """S k primitives, those of one row adjacent; differentiable.

        Args:
            centers: (S, k, 3) metres.
            parameters: those of `first_parameters`, and others that are not read.
        """
        sh = parameters[SH_DC].flatten(0, 1)
        if active_sh_degree > 0:
            rest = (active_sh_degree + 1) ** 2 - 1
            sh = torch.cat([sh, parameters[SH_REST].flatten(0, 1)[:, :rest]], dim=1)
        return self.splats(
            centers.flatten(0, 1),
            parameters[ROTATIONS].flatten(0, 1),
            self.activation.scale_of(parameters[RAW_SCALES]).flatten(0, 1),
            opacity_of(parameters[OPACITY_LOGITS]).flatten(),
            sh,
        )

    def constrain_(self, parameters: Mapping[str, Tensor]) -> None:
        """Bring raw parameters back into their bounds after a step, in place."""
        self.activation.constrain_(parameters[RAW_SCALES])
        parameters[OPACITY_LOGITS].clamp_(-OPACITY_LOGIT_MAX, OPACITY_LOGIT_MAX)

    def learning_rates(self, rates: Rates) -> dict[str, float]:
        """Of each raw parameter, by name."""
        return {
            ROTATIONS: rates.rotation,
            RAW_SCALES: rates.scale,
            OPACITY_LOGITS: rates.opacity,
            SH_DC: rates.color,
            SH_REST: rates.color * REST_SHARE,
        }

    def sizes(self, splats: Splats) -> Tensor:
        """(N,) metres: the largest scale of each."""
        return splats.scales.amax(dim=1)

    def children(
        self, copies: Mapping[str, Tensor], parents: Splats, draws: np.random.Generator, shrink: float
    ) -> dict[str, Tensor]:
        """Rows of N smaller primitives, each drawn from its parent's Gaussian.

        Args:
            copies: the parents' raw rows, one primitive each.
            parents: (N,) the same, activated.
            shrink: their scales are divided by it.
        """
        scales = self.axis_scales(parents)
        steps = torch.from_numpy(draws.standard_normal(tuple(scales.shape), dtype=np.float32)).to(scales.device)
        shift = (steps * scales).unsqueeze(2) * self.scale_axes(parents)
        return {
            **copies,
            OFFSETS: copies[OFFSETS] + shift.sum(dim=1, keepdim=True),
            RAW_SCALES: self.activation.raw_of(parents.scales[:, None] / shrink),
        }


def base_colors(splats: Splats) -> Tensor:
    """(N, 3) 0..1, without what depends on the direction."""
    return (0.5 + C0 * splats.sh[:, 0]).clamp(0, 1)


def mapped(splats: S, change: Callable[[Tensor], Tensor]) -> S:
    """The same kind, each tensor changed by a function."""
    return type(splats)(*map(change, splats))
