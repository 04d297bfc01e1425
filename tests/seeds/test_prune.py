import numpy as np

from room2dgs.seeds.prune import transparent, unseen


def test_one_opaque_surfel_keeps_a_seed():
    opacities = np.array([[0.004, 0.9, 0.001], [0.004, 0.0049, 0.0], [0.005, 0.0, 0.0]])
    assert transparent(opacities, 0.005).tolist() == [False, True, False]


def test_a_seed_may_miss_every_view_of_almost_two_epochs():
    # the last of one epoch's order can be the first of the next one's, or the other way round
    assert unseen(np.array([0, 19, 20, 21]), views=10).tolist() == [False, False, True, True]
