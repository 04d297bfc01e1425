"""Adding and removing seeds moves all that belongs to them."""

import copy

import pytest
import torch

from room2dgs.primitives.registry import new_primitive
from room2dgs.primitives.spawned import Spawned
from room2dgs.seeds.decoders.registry import new_decoder
from room2dgs.train.model import Model, adam_state, make_adam, set_rates
from room2dgs.train.strategies.ops import cap_parameter, copied_rows, edit_rows, joined_rows, separate_rows

SEEDS, PER_SEED, ADDED = 5, 2, 2
KEEP = torch.tensor([0, 3, 4])


def spawned(seeds: int, first: float) -> Spawned:
    """Every number differs, so that rows cannot be mistaken for each other."""

    def counted(*shape):
        return first + torch.arange(float(torch.Size(shape).numel())).reshape(shape) / 100

    return Spawned(
        positions=counted(seeds, 3),
        offsets=counted(seeds, PER_SEED, 3),
        rotations=counted(seeds, PER_SEED, 4),
        scales=counted(seeds, PER_SEED, 2) + 0.1,
        opacities=0.1 + counted(seeds, PER_SEED) / 1000,
        sh_dc=counted(seeds, PER_SEED, 3),
    )


@pytest.fixture(params=["explicit", "shared"])
def model(request, configure):
    """A model after three uneven steps."""
    degree = 1 if request.param == "explicit" else 0
    config = configure(f"seeds.decoder={request.param}", f"render.sh_degree={degree}")
    decoder = new_decoder(spawned(SEEDS, 0.0), new_primitive(config), config.seeds, degree, 0)
    model = Model(decoder, make_adam(decoder.parameters()), 3)
    set_rates(model.adam, dict.fromkeys(decoder.parameters(), 0.01))
    for step in range(3):
        for number, value in enumerate(decoder.parameters().values()):
            value.grad = torch.linspace(-1, 1, value.numel()).reshape(value.shape) * (1 + step) + number
        model.adam.step()
    return model


def all_tensors(model):
    return {
        name: value.detach().clone() for name, value in (model.decoder.fixed() | model.decoder.parameters()).items()
    }


def test_survivors_keep_values_and_moments_and_new_seeds_have_none(model):
    before, moments, per_seed = all_tensors(model), adam_state(model.adam), set(model.decoder.per_seed)
    moments = {key: value.clone() for key, value in moments.items()}
    rows = model.decoder.rows_of(spawned(ADDED, 7.0), None)
    edit_rows(model, KEEP, rows)

    after, kept = all_tensors(model), len(KEEP)
    assert model.seeds == kept + ADDED and model.count == (kept + ADDED) * PER_SEED
    assert after.keys() == before.keys()
    for name in after:
        if name in per_seed or name in model.decoder.fixed():
            assert torch.equal(after[name][:kept], before[name][KEEP])
            assert torch.equal(after[name][kept:], rows[name])
        else:
            assert torch.equal(after[name], before[name])
    now = adam_state(model.adam)
    assert now.keys() == moments.keys() and len(moments) == 3 * len(model.decoder.parameters())
    for key, value in now.items():
        moment, name = key.split("/")
        if moment == "step":
            assert value == 3
        elif name in per_seed:
            assert torch.equal(value[:kept], moments[key][KEEP]) and moments[key].abs().min() > 0
            assert (value[kept:] == 0).all() and len(value) == kept + ADDED
        else:
            assert torch.equal(value, moments[key])


def test_parameters_are_new_leaves_in_groups_of_the_same_names(model):
    names = [group["name"] for group in model.adam.param_groups]
    old = model.decoder.parameters()
    edit_rows(model, KEEP, model.decoder.rows_of(spawned(ADDED, 7.0), None))
    new = model.decoder.parameters()
    assert [group["name"] for group in model.adam.param_groups] == names == list(new)
    for group in model.adam.param_groups:
        (value,) = group["params"]
        assert value is new[group["name"]] and value is not old[group["name"]]
        assert value.is_leaf and value.requires_grad and value.grad is None
    # it goes on from there
    sum(value.sum() for value in model.splats(0)).backward()
    set_rates(model.adam, dict.fromkeys(new, 0.01))
    before = all_tensors(model)
    model.adam.step()
    assert all(value == 4 for key, value in adam_state(model.adam).items() if key.startswith("step/opacity"))
    assert any(not torch.equal(before[name], value) for name, value in all_tensors(model).items())


def test_removal_alone(model):
    before = all_tensors(model)
    edit_rows(model, KEEP)
    assert model.seeds == len(KEEP)
    assert torch.equal(model.decoder.fixed()["positions"], before["positions"][KEEP])


def test_keeping_all_changes_no_step_that_follows(model):
    twin = copy.deepcopy(model)
    edit_rows(model, torch.arange(SEEDS))
    for one in (model, twin):
        set_rates(one.adam, dict.fromkeys(one.decoder.parameters(), 0.01))
        for name, value in one.decoder.parameters().items():
            value.grad = torch.linspace(-2, 3, value.numel()).reshape(value.shape) * len(name)
        one.adam.step()
    ends = all_tensors(model), all_tensors(twin)
    assert all(torch.equal(ends[0][name], ends[1][name]) for name in ends[1])


def test_split_into_single_surfels_no_step_that_follows_differs(model):
    twin = copy.deepcopy(model)
    apart = separate_rows(model)
    assert apart == ("features" not in twin.decoder.parameters())
    assert model.seeds == SEEDS * (PER_SEED if apart else 1) and model.count == twin.count
    for one in (model, twin):
        set_rates(one.adam, dict.fromkeys(one.decoder.parameters(), 0.01))
        for name, value in one.decoder.parameters().items():
            value.grad = torch.linspace(-2, 3, value.numel()).reshape(value.shape) * len(name)
        one.adam.step()
    degree = 1 if apart else 0
    pairs = zip(model.splats(degree), twin.splats(degree), strict=True)
    assert all(torch.equal(mine, theirs) for mine, theirs in pairs)


def test_copies_join_into_rows_of_the_same_model(model):
    before = all_tensors(model)
    rows = joined_rows(copied_rows(model, torch.tensor([3, 1])), copied_rows(model, torch.tensor([1])))
    edit_rows(model, KEEP, rows)
    after = all_tensors(model)
    for name in (*model.decoder.per_seed, *model.decoder.fixed()):
        assert torch.equal(after[name], before[name][[0, 3, 4, 3, 1, 1]])


def test_a_capped_parameter_keeps_what_is_lower_and_loses_its_momentum(model):
    before = all_tensors(model)
    cap_parameter(model, "raw_scales", highest := float(before["raw_scales"].median()))
    after, state = all_tensors(model), adam_state(model.adam)
    assert torch.equal(after["raw_scales"], before["raw_scales"].clamp(max=highest))
    assert (before["raw_scales"] > highest).any() and torch.equal(after["offsets"], before["offsets"])
    for moment in ("exp_avg", "exp_avg_sq"):
        assert (state[f"{moment}/raw_scales"] == 0).all() and (state[f"{moment}/offsets"] != 0).any()
