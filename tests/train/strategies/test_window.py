import pytest

from room2dgs.errors import InputError
from room2dgs.train.strategies.strategy import Adjustment, window_of


@pytest.mark.parametrize(
    ("iterations", "settings", "first", "last"),
    [
        (30_000, ["strategy.start=0.05", "strategy.stop=0.5"], 1500, 15_000),  # the paper's
        (1000, ["strategy.start=0.05", "strategy.stop=0.5"], 100, 500),  # never without an interval behind it
        (7000, ["strategy.start=500", "strategy.stop=3000"], 500, 3000),
    ],
)
def test_times_are_shares_below_one_and_iterations_above(configure, iterations, settings, first, last):
    window = window_of(configure("strategy.every=100", *settings).strategy, iterations)
    due = [done for done in range(iterations + 1) if window.due(done)]
    assert (due[0], due[-1]) == (first, last)
    assert due == list(range(first, last + 1, 100))
    gathered = [iteration for iteration in range(iterations) if window.gathers(iteration)]
    assert gathered == list(range(first - 100, last))


def test_a_window_that_ends_before_it_begins_has_no_adjustment(configure):
    window = window_of(configure("strategy.start=900", "strategy.stop=100").strategy, 1000)
    assert not any(window.due(done) for done in range(1001))
    assert not any(window.gathers(iteration) for iteration in range(1000))


def test_the_line_tells_what_happened_and_nothing_else():
    done = Adjustment(added={"32 cm": 0, "2 cm": 41}, pruned={"transparent": 3, "unseen": 0})
    assert done.line() == "added 41 (2 cm); pruned 3 (transparent)"
    assert done.scalars()["seeds/added 32 cm"] == 0.0
    assert Adjustment(reset=True).line() == "opacities reset" and Adjustment().line() == "nothing added, nothing pruned"


def test_plain_densification_wants_single_explicit_surfels(configure):
    configure("strategy=plain", "seeds.per_seed=1")
    for wrong in (["seeds.per_seed=2"], ["seeds.per_seed=1", "seeds.decoder=shared"]):
        with pytest.raises(InputError, match=r"seeds\.per_seed=1 and seeds\.decoder=explicit"):
            configure("strategy=plain", *wrong)
