"""A value that comes with its gradients, as autograd sees it."""

from __future__ import annotations

import pytest
import torch

from room2dgs.losses.known_gradients import with_gradients


def test_gradients_reach_their_inputs_times_what_the_value_is_multiplied_with():
    a, b = torch.tensor([1.0, 2.0], requires_grad=True), torch.tensor(3.0, dtype=torch.float64, requires_grad=True)
    value = with_gradients(torch.tensor(5.0), [a, b], [torch.tensor([7.0, 8.0]), torch.tensor(9.0, dtype=b.dtype)])
    assert value == 5
    (10 * value).backward()
    assert a.grad.tolist() == [70, 80]
    assert b.grad == 90


def test_an_input_without_a_gradient_gets_none():
    a, fixed = torch.tensor(1.0, requires_grad=True), torch.tensor(2.0)
    with_gradients(torch.tensor(5.0), [fixed, a], [torch.tensor(7.0), torch.tensor(8.0)]).backward()
    assert (fixed.grad, a.grad) == (None, 8)


def test_a_second_backward_pass_is_refused_unless_it_was_asked_for():
    a = torch.tensor(1.0, requires_grad=True)
    value = with_gradients(torch.tensor(5.0), [a], [torch.tensor(7.0)])
    value.backward(retain_graph=True)
    with pytest.raises(RuntimeError, match="modified by an inplace operation"):
        value.backward()
    asked_for = with_gradients(torch.tensor(5.0), [a], [torch.tensor(7.0)], again=True)
    a.grad = None
    asked_for.backward(retain_graph=True)
    (2 * asked_for).backward()
    assert a.grad == 7 + 14
