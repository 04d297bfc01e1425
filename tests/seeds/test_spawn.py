import numpy as np
import pytest
import torch

from room2dgs.seeds.seeds import Seeds
from room2dgs.seeds.spawn import spawn


def some_seeds(count=7, seed=0):
    rng = np.random.default_rng(seed)
    normals = rng.normal(size=(count, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    positions = rng.uniform(-2, 2, (count, 3))
    return Seeds(
        positions=positions,
        surface=positions + rng.uniform(-0.01, 0.01, (count, 3)),
        normals=normals,
        spacing=rng.uniform(0.01, 0.1, count),
        rgb=rng.uniform(0, 1, (count, 3)),
    )


@pytest.mark.parametrize("per_seed", [1, 2, 10])
def test_offsets_differ_and_lie_in_the_tangent_plane_of_the_surface_point(per_seed):
    seeds = some_seeds()
    offsets = spawn(seeds, per_seed, 0.1, 0).offsets.double().numpy()
    from_surface = offsets - (seeds.surface - seeds.positions)[:, None]
    assert np.abs(np.einsum("ski,si->sk", from_surface, seeds.normals)).max() < 1e-7
    assert (np.linalg.norm(from_surface, axis=-1) <= seeds.spacing[:, None] + 1e-7).all()
    for own, spacing in zip(from_surface, seeds.spacing, strict=True):
        gaps = np.linalg.norm(own[:, None] - own[None], axis=-1) + np.eye(per_seed)
        assert gaps.min() > 0.3 * spacing / per_seed**0.5  # evenly spread, not merely distinct


def test_patterns_of_different_seeds_are_turned_differently():
    seeds = some_seeds(2)
    seeds = Seeds(seeds.positions, seeds.positions, np.tile([0.0, 0, 1], (2, 1)), np.full(2, 0.1), seeds.rgb)
    offsets = spawn(seeds, 5, 0.1, 0).offsets
    assert (offsets[0] - offsets[1]).abs().max() > 1e-3


def test_discs_cover_the_same_area_whatever_their_number():
    seeds = some_seeds()
    for per_seed in (1, 4, 10):
        area = (spawn(seeds, per_seed, 0.1, 0).scales ** 2).prod(dim=-1).sqrt().sum(dim=1)
        np.testing.assert_allclose(area, seeds.spacing**2, rtol=1e-5)


def test_seeded_bits():
    a, b, other = (spawn(some_seeds(), 3, 0.1, number) for number in (5, 5, 6))
    assert all(torch.equal(x, y) for x, y in zip(a, b, strict=True))
    assert not torch.equal(a.offsets, other.offsets)


def test_colour_comes_back_from_the_constant_harmonic():
    seeds = some_seeds()
    spawned = spawn(seeds, 2, 0.3, 0)
    np.testing.assert_allclose(
        0.5 + 0.28209479177387814 * spawned.sh_dc.numpy(), np.repeat(seeds.rgb[:, None], 2, axis=1), atol=1e-6
    )
    assert spawned.opacities.unique().tolist() == pytest.approx([0.3])
