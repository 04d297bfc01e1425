"""What the settings can name is what the registries hold, and an entry is all that a new one needs."""

import pytest

from room2dgs.errors import InputError
from room2dgs.registries.decoders import DECODERS
from room2dgs.registries.primitives import PRIMITIVES
from room2dgs.registries.strategies import STRATEGIES
from room2dgs.registry import Entry
from room2dgs.train import train
from room2dgs.train.objective import known_terms
from room2dgs.train.strategies.registry import new_strategy
from room2dgs.train.terms.term import LossTerm

both = lambda config, scene: (config, scene)  # noqa: E731
SINGLE = "seeds.per_seed=1"  # which strategy=plain wants


@pytest.mark.parametrize(
    "key, registry", [("strategy.name", STRATEGIES), ("seeds.decoder", DECODERS), ("primitive", PRIMITIVES)]
)
def test_settings_take_every_registered_name_and_no_other(configure, key, registry):
    for name in registry:
        configure(SINGLE, f"{key}={name}")
    with pytest.raises(InputError) as refused:
        configure(f"{key}=unheard_of")
    assert all(name in str(refused.value) for name in registry)


def test_a_strategy_added_to_the_registry_is_the_one_that_is_used(capture, configure, monkeypatch):
    monkeypatch.setitem(STRATEGIES._own, "fixed", Entry("strategy", "fixed", f"{__name__}:both", "For this test."))
    config = configure()
    assert new_strategy(config, capture[0]) == (config, capture[0])


def test_every_loss_term_has_its_settings_and_every_settings_their_term(configure):
    loss = configure().loss
    scheduled = {name for name, value in vars(loss).items() if hasattr(value, "ramp")}
    assert scheduled == known_terms().keys() - {"rgb"}


def test_a_term_added_to_the_registry_acts_by_its_weight_and_gets_what_it_reads(
    capture, configure, log, tmp_path, monkeypatch
):
    normals, contexts = [], []

    def upward(rendering, view, context):
        normals.append(rendering.normal.detach().abs().sum().item())
        contexts.append(context)
        return rendering.normal[..., 1].mean()

    def ramp(config, iteration):
        return 0.5 * (iteration >= 4)

    off = ["loss.normal_consistency.enabled=false", "train.log_every=1"]
    plain = train(*capture, configure(*off), tmp_path / "plain", log)
    monkeypatch.setitem(known_terms(), "upward", LossTerm(upward, reads=("normal",), weight=ramp))
    log.lines.clear()
    result = train(*capture, configure(*off), tmp_path / "more", log)
    assert ["upward" in line for line in log.lines if ": loss" in line] == [False] * 4 + [True] * 4
    assert result.losses["loss"] == pytest.approx(result.losses["rgb"] + 0.5 * result.losses["upward"], rel=1e-5)
    assert result.losses["loss"] != plain.losses["loss"]
    assert min(normals) > 0 and [context.iteration for context in contexts] == [4, 5, 6, 7]
    assert contexts[0].active == ("rgb", "upward") and contexts[0].target.shape == (24, 32, 3)
