import pytest
import torch

from room2dgs.primitives.activations import OPACITY_LOGIT_MAX, SCALE_MAX_M, SCALE_MIN_M
from room2dgs.primitives.spawned import Spawned
from room2dgs.primitives.surfel2d import Surfel2D
from room2dgs.seeds.decoders.explicit import explicit_decoder


def spawned(seeds=4, per_seed=3):
    generator = torch.Generator().manual_seed(0)

    def uniform(*shape):
        return torch.rand(*shape, generator=generator)

    return Spawned(
        positions=uniform(seeds, 3) * 4 - 2,
        offsets=uniform(seeds, per_seed, 3) * 0.1,
        rotations=uniform(seeds, per_seed, 4) + 0.1,
        scales=uniform(seeds, per_seed, 2) * 0.1 + 0.001,
        opacities=uniform(seeds, per_seed) * 0.9 + 0.05,
        sh_dc=uniform(seeds, per_seed, 3) - 0.5,
    )


def test_first_surfels_are_the_spawned_ones():
    start = spawned()
    surfels = explicit_decoder(start, Surfel2D(), 2).splats(0)
    assert torch.equal(surfels.centers, (start.positions[:, None] + start.offsets).reshape(-1, 3))
    assert torch.equal(surfels.rotations, start.rotations.reshape(-1, 4))
    torch.testing.assert_close(surfels.scales, start.scales.reshape(-1, 2), rtol=1e-5, atol=0)
    torch.testing.assert_close(surfels.opacities, start.opacities.reshape(-1), rtol=1e-5, atol=0)
    assert torch.equal(surfels.sh, start.sh_dc.reshape(-1, 1, 3))


@pytest.mark.parametrize(("degree", "coefficients"), [(0, 1), (1, 4), (2, 9), (3, 16)])
def test_active_degree_sets_the_number_of_coefficients(degree, coefficients):
    sh = explicit_decoder(spawned(), Surfel2D(), 3).splats(degree).sh
    assert sh.shape == (12, coefficients, 3)
    assert (sh[:, 1:] == 0).all()


def test_degree_zero_stores_no_further_coefficients():
    assert "sh_rest" not in explicit_decoder(spawned(), Surfel2D(), 0).parameters()


def test_seeds_are_fixed_and_everything_else_learns():
    decoder = explicit_decoder(spawned(), Surfel2D(), 1)
    sum((value**2).sum() for value in decoder.splats(1)).backward()
    gradients = {name: p.grad for name, p in decoder.parameters().items()}
    assert set(gradients) == {"offsets", "rotations", "raw_scales", "opacity_logits", "sh_dc", "sh_rest"}
    assert all(g is not None for g in gradients.values())
    assert decoder.fixed()["positions"].grad is None and not decoder.fixed()["positions"].requires_grad


def test_constrain_brings_back_what_ran_away_and_keeps_its_gradient():
    decoder = explicit_decoder(spawned(), Surfel2D(), 0)
    with torch.no_grad():
        decoder.leaves["raw_scales"][0] = 80.0
        decoder.leaves["raw_scales"][1] = -80.0
        decoder.leaves["opacity_logits"][2] = 1e4
        decoder.leaves["opacity_logits"][3] = -1e4
    decoder.constrain()
    surfels = decoder.splats(0)
    assert surfels.scales.max().item() == pytest.approx(SCALE_MAX_M, rel=1e-5)
    assert surfels.scales.min().item() == pytest.approx(SCALE_MIN_M, rel=1e-5)
    assert surfels.opacities.min() > 0 and surfels.opacities.max() < 1
    assert decoder.leaves["opacity_logits"].abs().max().item() == OPACITY_LOGIT_MAX
    (surfels.opacities.sum() + surfels.scales.sum()).backward()
    assert (decoder.leaves["opacity_logits"].grad > 0).all() and (decoder.leaves["raw_scales"].grad > 0).all()


def test_changing_a_decoder_leaves_the_spawned_tensors_alone():
    start = spawned()
    before = start.offsets.clone()
    with torch.no_grad():
        explicit_decoder(start, Surfel2D(), 0).leaves["offsets"].add_(1.0)
    assert torch.equal(start.offsets, before)
