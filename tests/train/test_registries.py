"""What the settings can name is what the registries hold."""

import pytest

from room2dgs.errors import InputError
from room2dgs.seeds.decoders.registry import DECODERS
from room2dgs.train.strategies.registry import STRATEGIES, new_strategy

SINGLE = "seeds.per_seed=1"  # which strategy=plain wants


@pytest.mark.parametrize("key, registry", [("strategy.name", STRATEGIES), ("seeds.decoder", DECODERS)])
def test_settings_take_every_registered_name_and_no_other(configure, key, registry):
    for name in registry:
        configure(SINGLE, f"{key}={name}")
    with pytest.raises(InputError) as refused:
        configure(f"{key}=unheard_of")
    assert all(name in str(refused.value) for name in registry)


def test_a_strategy_added_to_the_registry_is_the_one_that_is_used(capture, configure, monkeypatch):
    monkeypatch.setitem(STRATEGIES, "fixed", lambda config, scene: (config, scene))
    config = configure()
    assert new_strategy(config, capture[0]) == (config, capture[0])
