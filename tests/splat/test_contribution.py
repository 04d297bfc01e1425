"""What surfels add to pictures."""

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from room2dgs.geometry.spherical_harmonics import C0
from room2dgs.splat import Surfels, render
from room2dgs.splat.contribution import contributions, least_needed

SIZE = (24, 18)


@pytest.fixture
def stack():
    """Discs before and behind each other, dark and bright ones, one behind the camera; with two views."""
    drawn = torch.Generator().manual_seed(5)
    count = 12
    centers = torch.rand(count, 3, generator=drawn) * torch.tensor([1.2, 0.9, 2.0]) + torch.tensor([-0.6, -0.45, 1.0])
    centers[7, 2] = -2.0
    surfels = Surfels(
        centers=centers,
        rotations=torch.tensor([1.0, 0.1, 0.2, 0.0]).repeat(count, 1),
        scales=torch.full((count, 2), 0.15),
        opacities=torch.linspace(0.02, 0.95, count),
        sh=torch.linspace(-9, 9, 3 * count).view(count, 1, 3),  # most are cut off at black
    )
    K = torch.tensor([[20.0, 0, 12], [0, 20, 9], [0, 0, 1]])
    aside = torch.eye(4)
    aside[0, 3] = 0.2
    return surfels, [(K, torch.eye(4), *SIZE), (K, aside, *SIZE)]


def test_contributions_are_what_each_surfel_alone_would_paint_white_in_the_view_that_shows_most_of_it(stack):
    surfels, views = stack
    found = contributions(surfels, views, 0.05)
    for one in range(len(found)):
        sh = torch.full_like(surfels.sh, -0.5 / C0)  # black
        sh[one] = 0.5 / C0  # white
        painted = [render(surfels._replace(sh=sh), *view).color[..., 0].double().sum() for view in views]
        assert float(found[one]) == pytest.approx(float(max(painted)), rel=1e-4, abs=1e-5)
    assert found[7] == 0 and (found > 0).sum() >= 9


@settings(deadline=None)
@given(st.lists(st.floats(0, 1e6, width=32), min_size=1, max_size=40), st.floats(0, 0.99))
def test_those_that_go_hold_no_more_than_the_share_and_one_more_would(values, share):
    added = torch.tensor(values, dtype=torch.float64)
    least = least_needed(added, share)
    total = float(added.sum())
    assert float(added[least].sum()) <= share * total * (1 + 1e-9)
    if not least.all():
        following = float(added[~least].min())
        assert following >= float(added[least].max() if least.any() else 0)
        assert float(added[least].sum()) + following > share * total * (1 - 1e-9)
