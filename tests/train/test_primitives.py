"""What training, strategies, files and exports ask of a primitive, of one that is registered for this test alone."""

from __future__ import annotations

import math
import re
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
import pytest
import torch
from torch import Tensor

from room2dgs import splat
from room2dgs.geometry.rotations import normals, tangents
from room2dgs.primitives.primitive import BASES, Primitive, Rates, mapped
from room2dgs.primitives.registry import new_primitive, primitive_of, render
from room2dgs.primitives.spawned import Spawned
from room2dgs.primitives.surfel2d import Surfel2D
from room2dgs.registries.primitives import PRIMITIVES
from room2dgs.registry import Entry
from room2dgs.splat import Surfels
from room2dgs.train import load_surfels, save_surfels, train


class RoundDiscs(NamedTuple):
    centers: Tensor
    rotations: Tensor
    scales: Tensor
    opacities: Tensor
    sh: Tensor


class RoundDisc(Primitive):
    """A disc with one scale, drawn as a surfel whose scales are equal."""

    splats = RoundDiscs
    file_kind = "round discs"
    shapes = MappingProxyType({"centers": (3,), "rotations": (4,), "scales": (1,), "opacities": (), "sh": (BASES, 3)})

    def render(self, splats, K, cam_from_world, width, height, **options):
        return splat.render(self.as_discs(splats), K, cam_from_world, width, height, **options)

    def scale_axes(self, splats):
        return tangents(splats.rotations)

    def axis_scales(self, splats):
        return splats.scales.expand(-1, 2).contiguous()

    def normals(self, splats):
        return normals(splats.rotations)

    def footprints(self, splats):
        return splats.scales[:, 0]

    def as_discs(self, splats):
        return Surfels(*splats)._replace(scales=self.axis_scales(splats))

    def three_scales(self, splats):
        return np.column_stack([self.axis_scales(splats).numpy(), np.full(len(splats.scales), 1e-6, np.float32)])

    def first_scales(self, spawned):
        return spawned.scales[..., :1]


@pytest.fixture
def registered(monkeypatch):
    """The one step beside the class: an entry of the registry."""
    entry = Entry("primitive", "round_disc", f"{__name__}:RoundDisc", "For this test.")
    monkeypatch.setitem(PRIMITIVES._own, "round_disc", entry)


def spawned(seeds=2, per_seed=3):
    generator = torch.Generator().manual_seed(0)

    def uniform(*shape):
        return torch.rand(*shape, generator=generator)

    return Spawned(
        uniform(seeds, 3), uniform(seeds, per_seed, 3), uniform(seeds, per_seed, 4) + 0.1,
        uniform(seeds, per_seed, 2) + 0.01, uniform(seeds, per_seed), uniform(seeds, per_seed, 3),
    )  # fmt: skip


def activated(primitive):
    start = spawned()
    return primitive.activated(start.positions[:, None] + start.offsets, primitive.first_parameters(start, 0), 0)


@pytest.mark.parametrize("primitive", [Surfel2D(), RoundDisc()], ids=["surfel2d", "round_disc"])
def test_names_rates_shapes_and_parameters_are_of_one_piece(primitive):
    parameters = primitive.first_parameters(spawned(), 8)
    assert tuple(parameters) == primitive.parameters
    assert set(primitive.learning_rates(Rates(*range(7)))) == set(parameters)
    splats = activated(primitive)
    assert type(splats) is primitive.splats and tuple(primitive.shapes) == splats._fields
    for name, inner in primitive.shapes.items():
        assert tuple(getattr(splats, name).shape) == (6, *(1 if side == BASES else side for side in inner))


@pytest.mark.parametrize("primitive", [Surfel2D(), RoundDisc()], ids=["surfel2d", "round_disc"])
def test_normals_axes_scales_and_discs_describe_the_same_piece_of_surface(primitive):
    splats = activated(primitive)
    axes, scales = primitive.scale_axes(splats), primitive.axis_scales(splats)
    torch.testing.assert_close(axes @ axes.transpose(1, 2), torch.eye(2).expand(6, 2, 2), atol=1e-6, rtol=0)
    torch.testing.assert_close(torch.linalg.cross(axes[:, 0], axes[:, 1]), primitive.normals(splats), atol=1e-6, rtol=0)
    torch.testing.assert_close(primitive.footprints(splats).square(), scales.prod(dim=1), rtol=1e-5, atol=0)
    assert np.array_equal(primitive.three_scales(splats)[:, :2], scales.numpy())
    assert torch.equal(primitive.sizes(splats), scales.amax(dim=1))
    assert torch.equal(primitive.as_discs(splats).scales, scales)


def test_children_are_drawn_along_the_axes_with_their_scales_and_are_smaller():
    primitive = RoundDisc()
    count = 4000
    rotation = torch.tensor([0.8, 0.6, 0.0, 0.0]).repeat(count, 1)
    parents = RoundDiscs(
        torch.zeros(count, 3), rotation, torch.full((count, 1), 0.05), torch.ones(count), torch.ones(count, 1, 3)
    )
    copies = {"offsets": torch.zeros(count, 1, 3), "sh_dc": torch.ones(count, 1, 1, 3)}
    rows = primitive.children(copies, parents, np.random.default_rng(0), 1.6)
    along = rows["offsets"][:, 0] @ primitive.scale_axes(parents)[0].T
    assert along.std(dim=0).tolist() == pytest.approx([0.05, 0.05], rel=0.05)
    assert (rows["offsets"][:, 0] @ primitive.normals(parents)[0]).abs().max() < 1e-6
    assert rows["raw_scales"].exp().unique().tolist() == pytest.approx([0.05 / 1.6])
    assert rows["sh_dc"] is copies["sh_dc"]


def test_a_kind_is_found_by_its_splats_and_others_are_none(registered):
    assert isinstance(primitive_of(activated(RoundDisc())), RoundDisc)
    assert isinstance(primitive_of(activated(Surfel2D())), Surfel2D)
    with pytest.raises(TypeError, match="tuple is no kind of primitive"):
        primitive_of(tuple(activated(Surfel2D())))


def test_any_kind_is_rendered_as_its_own(registered):
    splats = mapped(activated(RoundDisc()), Tensor.detach)
    K = torch.tensor([[30.0, 0, 16], [0, 30, 12], [0, 0, 1]])
    cam_from_world = torch.eye(4)
    cam_from_world[2, 3] = 3.0
    mine = render(splats, K, cam_from_world, 32, 24)
    surfels = Surfels(*splats)._replace(scales=splats.scales.repeat(1, 2))
    assert torch.equal(mine.color, splat.render(surfels, K, cam_from_world, 32, 24).color)
    assert mine.alpha.max() > 0.1


@pytest.mark.parametrize("decoder", ["explicit", "shared"])
def test_a_registered_kind_trains_grows_resumes_and_is_read_back(
    registered, capture, configure, log, tmp_path, decoder
):
    settings = [
        "primitive=round_disc", f"seeds.decoder={decoder}", "strategy=seeds", "train.iterations=8", "strategy.every=2",
        "strategy.start=0", "strategy.stop=1.0", "strategy.grow_gradient=0", "strategy.min_visits=1",
        "train.checkpoint_every=4", "train.keep_checkpoints=2", "strategy.thin=0",
    ]  # fmt: skip
    whole = train(*capture, configure(*settings), tmp_path / "whole", log)
    assert any(re.search(r"added \d+ \(", line) for line in log.lines)
    found = load_surfels(whole.surfels_path)
    assert type(found) is RoundDiscs and found.scales.shape == (whole.surfels, 1)
    (tmp_path / "whole/checkpoints/iteration_0000008.safetensors").unlink()
    again = train(*capture, configure(*settings, "resume=true"), tmp_path / "whole", log)
    assert all(torch.equal(a, b) for a, b in zip(found, load_surfels(again.surfels_path), strict=True))


def test_single_ones_split_and_their_opacities_are_reset(registered, capture, configure, log, tmp_path):
    settings = [
        "primitive=round_disc", "strategy=plain", "seeds.per_seed=1", "train.iterations=8", "strategy.every=2",
        "strategy.start=0", "strategy.stop=1.0", "strategy.grow_gradient=0", "strategy.split_size=0",
        "strategy.reset_every=4", "strategy.max_surfels=5000", "strategy.prune_opacity=0",
    ]  # fmt: skip
    result = train(*capture, configure(*settings), tmp_path, log)
    lines = "\n".join(log.lines)
    assert "(split)" in lines and "opacities reset" in lines
    first = int(re.search(r"points, (\d+) seeds", lines)[1])
    assert first < result.surfels == result.seeds


def test_files_of_kinds_are_told_apart(registered, tmp_path):
    for primitive in (RoundDisc(), Surfel2D()):
        splats = mapped(activated(primitive), lambda values: values.detach().clamp(min=0.1, max=0.9).contiguous())
        path = tmp_path / f"{primitive.file_kind}.safetensors"
        save_surfels(path, splats, {})
        assert type(load_surfels(path)) is primitive.splats


def test_the_activation_of_the_settings_is_the_primitives(configure):
    activation = new_primitive(configure("seeds.scale_activation=softplus", "seeds.max_scale_m=0.05")).activation
    raw = activation.raw_of(torch.tensor([0.05]))
    assert float(raw) == pytest.approx(math.log(math.expm1(1.0)), rel=1e-5)
