import pytest
import torch

from room2dgs.config import load_config
from room2dgs.errors import InputError
from room2dgs.seeds.decoders.shared import FACTOR_MAX, FACTOR_MIN, shared_decoder
from room2dgs.seeds.spawn import Spawned
from room2dgs.splat import Surfels

SEEDS, SURFELS = 6, 4


def alike(seeds=SEEDS):
    """Seeds that differ in nothing but their place."""
    return Spawned(
        positions=torch.arange(3.0 * seeds).reshape(seeds, 3),
        offsets=torch.linspace(0, 0.1, SURFELS)[None, :, None].repeat(seeds, 1, 3),
        rotations=torch.tensor([1.0, 0, 0, 0]).repeat(seeds, SURFELS, 1),
        scales=torch.full((seeds, SURFELS, 2), 0.02),
        opacities=torch.full((seeds, SURFELS), 0.1),
        sh_dc=torch.zeros(seeds, SURFELS, 3),
    )


def test_a_few_steps_tell_alike_seeds_and_the_surfels_of_a_seed_apart():
    decoder = shared_decoder(alike(), 8, 0)
    wanted = torch.rand(SEEDS * SURFELS, generator=torch.Generator().manual_seed(1))
    adam = torch.optim.Adam(decoder.parameters().values(), lr=0.02)
    for _ in range(300):
        adam.zero_grad()
        error = ((decoder.surfels(0)[3] - wanted) ** 2).mean()
        error.backward()
        adam.step()
    assert error < 1e-3  # equal features would leave the spread over seeds, 0.06


def test_scales_stay_within_their_factors_of_the_seeds_scale():
    decoder = shared_decoder(alike(), 8, 0)
    with torch.no_grad():
        decoder.out_weight.normal_(0.0, 100.0, generator=torch.Generator().manual_seed(0))
    factors = Surfels(*decoder.surfels(0)).scales / 0.02
    assert factors.min().item() == pytest.approx(FACTOR_MIN, rel=1e-3)
    assert factors.max().item() == pytest.approx(FACTOR_MAX, rel=1e-3)


def test_a_surfel_that_all_but_vanished_keeps_a_gradient_to_come_back_by():
    decoder = shared_decoder(alike(), 8, 0)
    with torch.no_grad():
        decoder.out_bias[:SURFELS] = -50.0
    opacities = decoder.surfels(0)[3]
    assert (opacities < 1e-3).all()
    opacities.log().sum().backward()
    assert (decoder.out_bias.grad[:SURFELS] > 0.01).all()


def test_new_seeds_take_the_features_they_are_given():
    decoder = shared_decoder(alike(), 8, 0)
    parents = decoder.features[:2]
    rows = decoder.rows_of(alike(2), parents)
    assert torch.equal(rows["features"], parents) and not rows["features"].requires_grad
    assert torch.equal(decoder.rows_of(alike(2))["features"], torch.zeros(2, 8))


def test_seeded_bits():
    a, b, other = (shared_decoder(alike(), 8, seed).parameters() for seed in (3, 3, 4))
    assert all(torch.equal(a[name], b[name]) for name in a)
    assert not torch.equal(a["features"], other["features"])
    assert not torch.equal(a["hidden_weight"], other["hidden_weight"])


def test_view_dependent_colours_are_refused_with_the_way_out():
    with pytest.raises(InputError, match=r"render\.sh_degree=1 needs seeds\.decoder=explicit"):
        load_config(["scene.path=x", "out=x", "seeds.decoder=shared", "render.sh_degree=1"])
