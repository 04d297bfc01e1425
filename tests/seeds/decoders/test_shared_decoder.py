import numpy as np
import pytest
import torch

from room2dgs.config import load_config
from room2dgs.errors import InputError
from room2dgs.primitives.spawned import Spawned
from room2dgs.primitives.surfel2d import Surfel2D
from room2dgs.seeds.decoders.shared import FACTOR_MAX, FACTOR_MIN, shared_decoder
from room2dgs.seeds.hierarchy import Cells

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
    decoder = shared_decoder(alike(), Surfel2D(), 8, 0)
    wanted = torch.rand(SEEDS * SURFELS, generator=torch.Generator().manual_seed(1))
    adam = torch.optim.Adam(decoder.parameters().values(), lr=0.02)
    for _ in range(300):
        adam.zero_grad()
        error = ((decoder.splats(0).opacities - wanted) ** 2).mean()
        error.backward()
        adam.step()
    assert error < 1e-3  # equal features would leave the spread over seeds, 0.06


def test_scales_stay_within_their_factors_of_the_seeds_scale():
    decoder = shared_decoder(alike(), Surfel2D(), 8, 0)
    with torch.no_grad():
        decoder.out_weight.normal_(0.0, 100.0, generator=torch.Generator().manual_seed(0))
    factors = decoder.splats(0).scales / 0.02
    assert factors.min().item() == pytest.approx(FACTOR_MIN, rel=1e-3)
    assert factors.max().item() == pytest.approx(FACTOR_MAX, rel=1e-3)


def test_a_surfel_that_all_but_vanished_keeps_a_gradient_to_come_back_by():
    decoder = shared_decoder(alike(), Surfel2D(), 8, 0)
    with torch.no_grad():
        decoder.out_bias[:SURFELS] = -50.0
    opacities = decoder.splats(0).opacities
    assert (opacities < 1e-3).all()
    opacities.log().sum().backward()
    assert (decoder.out_bias.grad[:SURFELS] > 0.01).all()


def test_new_seeds_take_the_largest_features_of_their_families():
    decoder = shared_decoder(alike(), Surfel2D(), 8, 0)
    of_seed = [SURFELS * seed for seed in range(SEEDS)]  # one primitive of each
    order = np.array([of_seed[4] + 1, of_seed[0], of_seed[2] + 3, of_seed[2]])
    families = Cells(np.array([5, 9]), order, np.array([0, 1]), np.array([1, 3]))
    rows = decoder.rows_of(alike(2), families)
    wanted = torch.stack([decoder.features[4], decoder.features[[0, 2]].amax(dim=0)])
    assert torch.equal(rows["features"], wanted) and not rows["features"].requires_grad
    assert torch.equal(decoder.rows_of(alike(2))["features"], torch.zeros(2, 8))


def test_seeded_bits():
    a, b, other = (shared_decoder(alike(), Surfel2D(), 8, seed).parameters() for seed in (3, 3, 4))
    assert all(torch.equal(a[name], b[name]) for name in a)
    assert not torch.equal(a["features"], other["features"])
    assert not torch.equal(a["hidden_weight"], other["hidden_weight"])


def test_view_dependent_colours_are_refused_with_the_way_out():
    with pytest.raises(InputError, match=r"render\.sh_degree=1 needs seeds\.decoder=explicit"):
        load_config(["scene.path=x", "out=x", "seeds.decoder=shared", "render.sh_degree=1"])
