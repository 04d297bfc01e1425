"""Quaternions, matrices and axes, each against the other and against the definition."""

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from room2dgs.geometry.rotations import normals, quaternions_from, quaternions_to, rotation_matrices, tangents


def random_quaternions(seed: int, count: int = 5) -> torch.Tensor:
    return torch.from_numpy(np.random.default_rng(seed).normal(size=(count, 4)))


@given(st.integers(0, 500), st.sampled_from([1e-30, 1.0, 37.0]))
def test_a_matrix_gives_its_quaternion_back_whatever_the_norm(seed, norm):
    quaternions = random_quaternions(seed)
    unit = quaternions / quaternions.norm(dim=1, keepdim=True)
    matrices = rotation_matrices(norm * unit)
    np.testing.assert_allclose(matrices @ matrices.transpose(1, 2), np.tile(np.eye(3), (5, 1, 1)), atol=1e-12)
    np.testing.assert_allclose(torch.linalg.det(matrices), 1.0, atol=1e-12)
    back = quaternions_from(matrices.numpy())
    assert (back[:, 0] >= 0).all()
    np.testing.assert_allclose(back, unit * torch.sign(unit[:, :1]), atol=1e-9)


def test_a_quarter_turn_about_z_takes_x_to_y():
    half = np.sqrt(0.5)
    matrix = rotation_matrices(torch.tensor([[half, 0, 0, half]], dtype=torch.float64))[0]
    np.testing.assert_allclose(matrix @ torch.tensor([1.0, 0, 0], dtype=torch.float64), [0, 1, 0], atol=1e-12)


def test_axes_are_the_columns_and_right_handed():
    quaternions = random_quaternions(3)
    matrices = rotation_matrices(quaternions)
    t_u, t_v = tangents(quaternions).unbind(1)
    assert torch.equal(torch.stack([t_u, t_v, normals(quaternions)], dim=2), matrices)
    np.testing.assert_allclose(torch.linalg.cross(t_u, t_v), normals(quaternions), atol=1e-12)


def test_gradients_of_the_matrix_are_exact():
    assert torch.autograd.gradcheck(rotation_matrices, random_quaternions(1).requires_grad_())


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_no_quaternion_counts_as_no_rotation(dtype):
    assert torch.equal(rotation_matrices(torch.zeros(1, 4, dtype=dtype))[0], torch.eye(3, dtype=dtype))


@given(st.integers(0, 500), st.booleans())
def test_quaternions_take_z_to_the_normal(seed, near_minus_z):
    rng = np.random.default_rng(seed)
    normals = rng.normal(size=(4, 3))
    if near_minus_z:
        normals = normals * [1e-7, 1e-7, 0] + [0, 0, -1]
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    axes = rotation_matrices(torch.from_numpy(quaternions_to(normals)))[:, :, 2].numpy()
    np.testing.assert_allclose(axes, normals, atol=1e-9)


def test_exactly_opposite_normal_is_half_a_turn():
    axes = rotation_matrices(torch.from_numpy(quaternions_to(np.array([[0.0, 0.0, -1.0]]))))
    np.testing.assert_allclose(axes[0, :, 2], [0, 0, -1], atol=1e-15)
