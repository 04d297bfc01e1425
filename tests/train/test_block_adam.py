"""Adam on the seen rows: the kernel for CUDA, as plain C++, against torch's Adam in float64."""

from __future__ import annotations

import pytest
import torch

from room2dgs import _C

RATE, BETAS, EPSILON = 0.01, (0.9, 0.999), 1e-15
ROWS, WIDTH, STEPS = 700, 3, 5  # some blocks, the last one not full


def drawn(shape, seed):
    return torch.randn(shape, generator=torch.Generator().manual_seed(seed))


def stepped(seen_of, order=0):
    """Parameters and moments after some steps; seen_of(step) gives the rows seen, or None for all."""
    p, m, v = drawn((ROWS, WIDTH), 0), torch.zeros(ROWS, WIDTH), torch.zeros(ROWS, WIDTH)
    for step in range(1, STEPS + 1):
        seen = seen_of(step)
        seen = None if seen is None else seen.view(torch.uint8)
        _C.device.adam_rows(p, drawn((ROWS, WIDTH), step), m, v, seen, RATE, *BETAS, EPSILON, step, order)
    return p, m, v


def test_all_rows_are_torchs_adam():
    leaf = drawn((ROWS, WIDTH), 0).double().requires_grad_()
    adam = torch.optim.Adam([leaf], lr=RATE, betas=BETAS, eps=EPSILON)
    for step in range(1, STEPS + 1):
        leaf.grad = drawn((ROWS, WIDTH), step).double()
        adam.step()
    p, m, v = stepped(lambda _: None)
    state = adam.state[leaf]
    for found, exact in ((p, leaf.detach()), (m, state["exp_avg"]), (v, state["exp_avg_sq"])):
        torch.testing.assert_close(found.double(), exact, rtol=1e-5, atol=1e-6)


def some(step):
    return drawn((ROWS,), 100 + step) > 0


def test_rows_that_are_not_seen_keep_everything_and_the_others_are_torchs_sparse_adam():
    leaf = drawn((ROWS, WIDTH), 0).double().requires_grad_()
    adam = torch.optim.SparseAdam([leaf], lr=RATE, betas=BETAS, eps=EPSILON)
    for step in range(1, STEPS + 1):
        rows = some(step).nonzero().T
        values = drawn((ROWS, WIDTH), step).double()[rows[0]]
        leaf.grad = torch.sparse_coo_tensor(rows, values, (ROWS, WIDTH), check_invariants=True)
        adam.step()
    found = stepped(some)
    torch.testing.assert_close(found[0].double(), leaf.detach(), rtol=1e-5, atol=1e-6)
    never = ~torch.stack([some(step) for step in range(1, STEPS + 1)]).any(0)
    assert never.any() and torch.equal(found[0][never], drawn((ROWS, WIDTH), 0)[never]) and not found[1][never].any()
    for order in (1, 77):
        assert all(torch.equal(a, b) for a, b in zip(stepped(some, order), found, strict=True))


def test_arguments_are_checked():
    p, g, m, v = (torch.zeros(4, 3) for _ in range(4))
    numbers = (RATE, *BETAS, EPSILON)
    for wrong, kind in (
        ((p, g, m, v, torch.ones(3, dtype=torch.uint8), *numbers, 1), ValueError),
        ((p, g, m, v, torch.ones(4), *numbers, 1), TypeError),
        ((p, g, m, m, None, *numbers, 1), ValueError),
        ((p, g, m, v, None, *numbers, 0), ValueError),
        ((p, g, m, v, None, RATE, 1.0, 0.999, EPSILON, 1), ValueError),
    ):
        with pytest.raises(kind):
            _C.device.adam_rows(*wrong)
