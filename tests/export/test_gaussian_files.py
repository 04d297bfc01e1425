"""Gaussian files, decoded by small readers that share nothing with the writers."""

from __future__ import annotations

import gzip
import struct

import numpy as np
import pytest
import torch

from room2dgs.export.axes import turned, up_of, y_down_from, y_up_from
from room2dgs.export.gaussian_ply import gaussian_ply
from room2dgs.export.splat_file import splat_bytes
from room2dgs.export.spz import spz_bytes
from room2dgs.geometry.rotations import rotation_matrices
from room2dgs.geometry.spherical_harmonics import sh_color

Z_UP = np.array([0, 0, 1.0])


def read_ply(data: bytes) -> tuple[list[str], dict[str, np.ndarray]]:
    head, _, body = data.partition(b"end_header\n")
    lines = head.decode("ascii").splitlines()
    assert lines[:2] == ["ply", "format binary_little_endian 1.0"]
    names = [line.split()[2] for line in lines if line.startswith("property float ")]
    (count,) = (int(line.split()[2]) for line in lines if line.startswith("element vertex"))
    assert len(body) == 4 * count * len(names)
    rows = np.frombuffer(body, "<f4").reshape(count, len(names))
    return [line for line in lines if line.startswith("comment")], dict(zip(names, rows.T, strict=True))


def covariances(rotations: torch.Tensor, scales: np.ndarray) -> np.ndarray:
    R = rotation_matrices(rotations.double()).numpy()
    return np.einsum("nij,nj,nkj->nik", R, scales.astype(float) ** 2, R)


def test_ply_holds_what_a_3dgs_viewer_computes_with(surfels):
    _, found = read_ply(gaussian_ply(surfels))
    assert list(found)[:9] == ["x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2"]
    assert list(found)[9 + 24 :] == ["opacity", *(f"scale_{i}" for i in range(3)), *(f"rot_{i}" for i in range(4))]
    np.testing.assert_allclose(1 / (1 + np.exp(-found["opacity"])), surfels.opacities, atol=1e-6)
    np.testing.assert_allclose(np.exp(found["scale_1"]), surfels.scales[:, 1], rtol=1e-5)
    np.testing.assert_allclose(np.exp(found["scale_2"]), 1e-6, rtol=1e-5)
    # coefficient k of channel c, counted from the first after the constant one
    np.testing.assert_allclose(found["f_rest_11"], surfels.sh[:, 4, 1], atol=1e-7)
    axis = rotation_matrices(torch.tensor(np.stack([found[f"rot_{i}"] for i in range(4)], axis=1)))[:, :, 2]
    np.testing.assert_allclose(axis, np.stack([found[name] for name in ("nx", "ny", "nz")], axis=1), atol=1e-5)


def test_without_the_third_scale_nothing_else_changes(surfels):
    thick, (said, flat) = read_ply(gaussian_ply(surfels))[1], read_ply(gaussian_ply(surfels, False, ["discs"]))
    assert set(thick) - set(flat) == {"scale_2"} and said == ["comment discs"]
    assert all(np.array_equal(flat[name], thick[name]) for name in flat)


def test_padding_to_degree_3_keeps_the_colours(surfels):
    _, found = read_ply(gaussian_ply(surfels, sh_degree=3))
    assert sum(name.startswith("f_rest") for name in found) == 45
    np.testing.assert_allclose(found["f_rest_18"], surfels.sh[:, 4, 1], atol=1e-7)
    assert not found["f_rest_14"].any()


def test_opacities_of_0_and_1_stay_finite(surfels):
    ends = surfels._replace(opacities=torch.cat([torch.zeros(150), torch.ones(150)]))
    assert np.isfinite(read_ply(gaussian_ply(ends))[1]["opacity"]).all()


def test_splat_records(surfels):
    data = splat_bytes(surfels)
    rows = np.frombuffer(data, np.uint8).reshape(-1, 32)
    place = rows[:, :12].copy().view("<f4")
    scale = rows[:, 12:24].copy().view("<f4")
    weight = scale[:, 0] * scale[:, 1] * rows[:, 27]
    assert (np.diff(weight) <= weight.max() * 0.01).all()  # opacity is rounded in the file alone
    which = [int(np.abs(surfels.centers.numpy() - one).sum(axis=1).argmin()) for one in place]
    assert sorted(which) == list(range(300))
    np.testing.assert_array_equal(scale[:, :2], surfels.scales[which])
    color = (0.5 + 0.28209479177387814 * surfels.sh[which, 0]).clamp(0, 1)
    np.testing.assert_allclose(rows[:, 24:27] / 255, color, atol=0.5 / 255 + 1e-6)
    quaternions = torch.tensor((rows[:, 28:].astype(float) - 128) / 128)
    off = covariances(quaternions, scale) - covariances(surfels.rotations[which], scale)
    assert np.abs(off).max() < 0.02 * scale.max() ** 2


def read_spz(data: bytes) -> dict[str, np.ndarray]:
    """By the format's own description: attributes one after the other."""
    raw = gzip.decompress(data)
    magic, version, count, degree, bits, flags, zero = struct.unpack("<IIIBBBB", raw[:16])
    assert (magic, version, flags, zero) == (0x5053474E, 3, 0, 0)
    coefficients = (degree + 1) ** 2 - 1
    parts, start = {}, 16
    for name, size in dict(position=9, alpha=1, color=3, scale=3, rotation=4, sh=3 * coefficients).items():
        parts[name] = np.frombuffer(raw, np.uint8, count * size, start).reshape(count, size).astype(np.int64)
        start += count * size
    assert start == len(raw)
    low, middle, high = parts["position"].reshape(count, 3, 3).transpose(2, 0, 1)
    fixed = low + (middle << 8) + (high << 16)
    packed = parts["rotation"] @ (1 << np.array([0, 8, 16, 24]))
    return {
        "position": np.where(fixed >= 1 << 23, fixed - (1 << 24), fixed) / 2**bits,
        "alpha": parts["alpha"][:, 0] / 255,
        "dc": (parts["color"] / 255 - 0.5) / 0.15,
        "scale": np.exp(parts["scale"] / 16 - 10),
        "wxyz": np.stack([smallest_three(int(value)) for value in packed]),
        "sh": (parts["sh"].reshape(count, coefficients, 3) - 128) / 128,
    }


def smallest_three(value: int) -> list[float]:
    largest, q = value >> 30, [0.0] * 4
    for index in (3, 2, 1, 0):  # the last one lies lowest
        if index != largest:
            size, sign = value & 511, value >> 9 & 1
            q[index] = (-1 if sign else 1) * size / 511 * 0.5**0.5
            value >>= 10
    q[largest] = max(0.0, 1 - sum(part * part for part in q)) ** 0.5
    return [q[3], *q[:3]]


def test_spz_by_its_specification(surfels):
    found = read_spz(spz_bytes(surfels))
    np.testing.assert_allclose(found["position"], surfels.centers, atol=0.5 / 4096 + 1e-6)
    np.testing.assert_allclose(found["alpha"], surfels.opacities, atol=0.5 / 255 + 1e-6)
    np.testing.assert_allclose(found["dc"], surfels.sh[:, 0], atol=0.5 / 255 / 0.15 + 1e-6)
    np.testing.assert_allclose(found["scale"][:, :2], surfels.scales, rtol=0.033)
    np.testing.assert_allclose(found["scale"][:, 2], np.exp(-10), rtol=1e-6)
    np.testing.assert_allclose(found["sh"][:, :3], surfels.sh[:, 1:4], atol=4.6 / 128)
    np.testing.assert_allclose(found["sh"][:, 3:], surfels.sh[:, 4:], atol=8.6 / 128)
    dots = np.abs((found["wxyz"] * surfels.rotations.numpy()).sum(axis=1)).clip(0, 1)
    assert np.degrees(2 * np.arccos(dots)).max() < 0.25


@pytest.mark.parametrize("up", [Z_UP, np.array([0, -1.0, 0]), np.array([1.0, 0, 0]), np.array([0.6, 0.0, 0.8])])
def test_turned_frames_are_rotations_with_up_along_y(up):
    for rotation, sign in ((y_up_from(up), 1), (y_down_from(up), -1)):
        np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(rotation) == pytest.approx(1)
        np.testing.assert_allclose(rotation @ up, [0, sign, 0], atol=1e-12)


def test_a_z_up_world_in_the_two_frames():
    point = np.array([1.0, 2.0, 3.0])
    np.testing.assert_array_equal(y_up_from(Z_UP) @ point, [1, 3, -2])
    np.testing.assert_array_equal(y_down_from(Z_UP) @ point, [1, -3, 2])


def test_turned_surfels_look_the_same_from_every_side(surfels):
    rotation = y_down_from(np.array([0.48, 0.6, 0.64]))
    found = turned(surfels, rotation)
    np.testing.assert_allclose(found.centers, surfels.centers.double().numpy() @ rotation.T, atol=1e-5)
    flat = np.column_stack([surfels.scales.numpy(), np.zeros(300)])
    before, after = covariances(surfels.rotations, flat), covariances(found.rotations, flat)
    np.testing.assert_allclose(after, rotation @ before @ rotation.T, atol=1e-8)
    seen = torch.nn.functional.normalize(torch.randn(300, 3, generator=torch.Generator().manual_seed(1)), dim=1)
    turned_rays = seen @ torch.tensor(rotation.T, dtype=torch.float32)
    np.testing.assert_allclose(sh_color(found.sh, turned_rays), sh_color(surfels.sh, seen), atol=1e-5)


def test_up_is_found_given_or_kept(make):
    cameras = [make.camera_at((0, 0, 0), (np.cos(a), np.sin(a), -0.3)) for a in np.linspace(0, 6, 12)]
    assert up_of("keep", cameras, np.zeros((0, 3))) is None
    np.testing.assert_array_equal(up_of("-y", cameras, np.zeros((0, 3))), [0, -1, 0])
    slightly = np.array([0.01, 0.0, 1.0]) / np.hypot(1, 0.01)
    np.testing.assert_array_equal(up_of("auto", cameras, np.tile(slightly, (9, 1))), [0, 0, 1])
    leaning = np.array([0.1, 0.0, 1.0]) / np.hypot(1, 0.1)
    np.testing.assert_allclose(up_of("auto", cameras, np.tile(-leaning, (9, 1))), leaning, atol=1e-9)
