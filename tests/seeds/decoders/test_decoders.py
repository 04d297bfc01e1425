"""What holds for every decoder and every scale activation."""

import pytest
import torch

from room2dgs.config import load_config
from room2dgs.primitives.registry import new_primitive
from room2dgs.primitives.spawned import Spawned
from room2dgs.seeds.decoders.explicit import ExplicitDecoder
from room2dgs.seeds.decoders.registry import new_decoder, restored_decoder
from room2dgs.seeds.decoders.shared import SharedDecoder

KINDS = [("explicit", "exp"), ("explicit", "softplus"), ("shared", "exp"), ("shared", "softplus")]
every_kind = pytest.mark.parametrize(("kind", "activation"), KINDS)


def spawned(seeds=4, per_seed=3, random=0):
    """As `spawn` makes them: the surfels of a seed differ in their offsets alone."""
    generator = torch.Generator().manual_seed(random)

    def uniform(*shape):
        return torch.rand(*shape, generator=generator)

    def repeated(rows):
        return rows[:, None].repeat(1, per_seed, 1)

    return Spawned(
        positions=uniform(seeds, 3) * 4 - 2,
        offsets=uniform(seeds, per_seed, 3) * 0.1,
        rotations=repeated(uniform(seeds, 4) + 0.1),
        scales=repeated(uniform(seeds, 2) * 0.1 + 0.001),
        opacities=torch.full((seeds, per_seed), 0.15),
        sh_dc=repeated(uniform(seeds, 3) - 0.5),
    )


def settings(kind="explicit", activation="exp", *more):
    choice = [f"seeds.decoder={kind}", f"seeds.scale_activation={activation}"]
    return load_config(["scene.path=x", "out=x", "seeds.feature_size=5", *choice, *more])


def a_decoder(kind, activation, start=None):
    return decoder_of(settings(kind, activation), start)


def decoder_of(config, start=None):
    return new_decoder(start or spawned(), new_primitive(config), config.seeds, 0, 7)


def scrambled(decoder, spread=0.3, seed=1):
    """Every parameter moved, so that nothing is zero or alike by construction."""
    generator = torch.Generator().manual_seed(seed)
    with torch.no_grad():
        for value in decoder.parameters().values():
            value.add_(spread * torch.randn(value.shape, generator=generator, dtype=value.dtype))
    return decoder


def doubles(decoder):
    fixed, parameters = (
        {name: value.detach().double() for name, value in part.items()}
        for part in (decoder.fixed(), decoder.parameters())
    )
    return decoder.with_tensors(fixed, parameters)


@every_kind
def test_every_decoder_starts_from_the_spawned_surfels(kind, activation):
    start = spawned()
    surfels = a_decoder(kind, activation, start).splats(0)
    assert torch.equal(surfels.centers, (start.positions[:, None] + start.offsets).reshape(-1, 3))
    assert torch.equal(surfels.rotations, start.rotations.reshape(-1, 4))
    torch.testing.assert_close(surfels.scales, start.scales.reshape(-1, 2), rtol=4e-6, atol=0)
    torch.testing.assert_close(surfels.opacities, start.opacities.reshape(-1), rtol=1e-5, atol=0)
    torch.testing.assert_close(surfels.sh, start.sh_dc.reshape(-1, 1, 3), rtol=0, atol=1e-6)


@every_kind
def test_gradients_are_exact(kind, activation):
    decoder = doubles(scrambled(a_decoder(kind, activation, spawned(3, 2))))
    names = list(decoder.parameters())

    def surfels(*values):
        return tuple(decoder.with_tensors(decoder.fixed(), dict(zip(names, values, strict=True))).splats(0))

    inputs = tuple(value.detach().requires_grad_(True) for value in decoder.parameters().values())
    assert torch.autograd.gradcheck(surfels, inputs)


@every_kind
def test_every_parameter_of_a_moved_decoder_learns_and_the_seeds_do_not(kind, activation):
    decoder = scrambled(a_decoder(kind, activation))
    sum((value**2).sum() for value in decoder.splats(0)).backward()
    assert all((p.grad != 0).any() for p in decoder.parameters().values())
    assert not decoder.fixed()["positions"].requires_grad


@every_kind
def test_one_row_a_seed_in_what_is_per_seed_and_fixed(kind, activation):
    few, many = (a_decoder(kind, activation, spawned(seeds)) for seeds in (3, 5))
    assert few.count() == 9 and many.count() == 15
    for name, value in few.parameters().items():
        seeds = (len(value), len(many.parameters()[name]))
        assert seeds == (3, 5) if name in few.per_seed else seeds[0] == seeds[1]
    assert set(few.per_seed) <= set(few.parameters())
    assert [len(value) for value in many.fixed().values()] == [5]


@every_kind
def test_new_seeds_come_behind_and_leave_the_old_surfels_as_they_were(kind, activation):
    decoder = scrambled(a_decoder(kind, activation))
    added = spawned(2, random=9)
    rows = decoder.rows_of(added)
    assert set(rows) == {*decoder.per_seed, *decoder.fixed()}
    assert not any(row.requires_grad for row in rows.values())

    def grown(tensors):
        return {name: torch.cat([value, rows[name]]) if name in rows else value for name, value in tensors.items()}

    larger = decoder.with_tensors(grown(decoder.fixed()), grown(decoder.parameters()))
    before, after = decoder.splats(0), larger.splats(0)
    for old, now in zip(before, after, strict=True):
        torch.testing.assert_close(now[: len(old)], old, rtol=1e-6, atol=1e-6)
    assert torch.equal(after.centers[12:], (added.positions[:, None] + added.offsets).reshape(-1, 3))
    if kind == "explicit":
        torch.testing.assert_close(after.scales[12:], added.scales.reshape(-1, 2), rtol=4e-6, atol=0)
        torch.testing.assert_close(after.opacities[12:], added.opacities.reshape(-1), rtol=1e-5, atol=0)


@every_kind
def test_a_restored_decoder_has_the_same_surfels_and_learns(kind, activation):
    decoder = scrambled(a_decoder(kind, activation))
    copies = [
        {name: t.detach().clone() for name, t in part.items()} for part in (decoder.fixed(), decoder.parameters())
    ]
    config = settings(kind, activation)
    back = restored_decoder(new_primitive(config), config.seeds, *copies)
    assert type(back) is type(decoder) and list(back.parameters()) == list(decoder.parameters())
    assert all(torch.equal(a, b) for a, b in zip(decoder.splats(0), back.splats(0), strict=True))
    assert all(p.is_leaf and p.requires_grad for p in back.parameters().values())


@every_kind
def test_constrained_surfels_stay_drawable_however_far_parameters_ran(kind, activation):
    for spread in (10.0, 1e4):
        decoder = scrambled(a_decoder(kind, activation), spread)
        decoder.constrain()
        surfels = decoder.splats(0)
        assert surfels.scales.min() >= 0.99e-5 and surfels.scales.max() <= 10.01
        assert surfels.opacities.min() > 0 and surfels.opacities.max() < 1
        assert all(torch.isfinite(value).all() for value in surfels)


def test_softplus_counts_in_the_largest_first_scale():
    activation = decoder_of(settings("explicit", "softplus", "seeds.max_scale_m=0.05")).primitive.activation
    assert (activation.name, activation.unit_m) == ("softplus", 0.05)


def test_the_settings_name_the_decoder():
    assert isinstance(a_decoder("explicit", "exp"), ExplicitDecoder)
    assert isinstance(a_decoder("shared", "exp"), SharedDecoder)
