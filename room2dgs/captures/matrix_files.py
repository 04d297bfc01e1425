"""Text files with one matrix: camera poses and pinhole intrinsics."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from room2dgs.captures.capture import Lost
from room2dgs.errors import InputError
from room2dgs.geometry.poses import rigid_pose
from room2dgs.regular_files import open_regular

# Largest |R^T R - I| put down to rounded text and repaired; three decimals give at most 2e-3.
ROTATION_TOLERANCE = 5e-3
MAX_BYTES = 1 << 16  # of a file with one matrix


class NonFinitePose(Lost):
    """A pose file of inf or NaN: how ScanNet marks a frame whose tracking was lost."""


def read_world_from_cam(path: Path) -> np.ndarray:
    """Read a camera-to-world pose.

    Args:
        path: 16 numbers, row by row, white space or commas between them; comments (#) do not count.

    Returns:
        (4, 4) float64, rigid to the last digit: a rotation that text has rounded is replaced by the
        nearest one (Procrustes by SVD).

    Raises:
        NonFinitePose: a number is inf or NaN.
        InputError: the file is missing, is not a 4x4 matrix, or the matrix is not rigid.
    """
    pose = read_matrix(path, (4,))
    if not np.isfinite(pose).all():
        raise NonFinitePose(f"{path.parent.name}/{path.name} holds inf or NaN (tracking lost)")
    return rigid(pose, path, "write it row by row as 4x4")


def rigid(pose: np.ndarray, label: object, mend: str = "write the poses again") -> np.ndarray:
    """(4, 4) float64, rigid to the last digit: a rotation that text has rounded is replaced by the nearest one.

    Args:
        pose: (4, 4), finite.
        label: what messages call it; mend: what to do about a last row that is wrong.

    Raises:
        InputError: it is not rigid.
    """
    if not np.allclose(pose[3], (0.0, 0.0, 0.0, 1.0), rtol=0.0, atol=1e-6):
        raise InputError(f"{label} is not a rigid pose, its last row is not 0 0 0 1; {mend}")
    rotation = pose[:3, :3]
    error = np.abs(rotation.T @ rotation - np.eye(3)).max()
    if error > ROTATION_TOLERANCE or np.linalg.det(rotation) < 0.0:
        raise InputError(
            f"{label} is not a rigid pose, its 3x3 part is no rotation (|R^T R - I| = {error:.2g}, "
            f"determinant {np.linalg.det(rotation):.3g}); remove scale and mirroring, or delete the frame"
        )
    left, _, right = np.linalg.svd(rotation)
    return rigid_pose(left @ right, pose[:3, 3])


def read_intrinsics(path: Path) -> np.ndarray:
    """Read pinhole intrinsics as they stand on disk (pixel-centre convention not converted).

    Args:
        path: 9 or 16 numbers, row by row; of a 4x4 matrix the upper left 3x3 part counts.

    Returns:
        (3, 3) float64 K in pixels, zero skew.

    Raises:
        InputError: the file is missing, is not a 3x3 or 4x4 matrix, or is no pinhole camera.
    """
    matrix = read_matrix(path, (3, 4))
    K = matrix[:3, :3]
    if not np.isfinite(K).all() or K[0, 0] <= 0.0 or K[1, 1] <= 0.0:
        raise InputError(f"{path} has no positive finite focal lengths; write fx 0 cx / 0 fy cy / 0 0 1")
    rest = np.array([K[0, 1] / K[0, 0], K[1, 0] / K[1, 1], K[2, 0], K[2, 1], K[2, 2] - 1.0])
    if np.abs(rest).max() > 1e-6:
        raise InputError(f"{path} is not a pinhole camera without skew; write fx 0 cx / 0 fy cy / 0 0 1")
    return np.array([[K[0, 0], 0.0, K[0, 2]], [0.0, K[1, 1], K[1, 2]], [0.0, 0.0, 1.0]])


def read_matrix(path: Path, sizes: tuple[int, ...] = (4,)) -> np.ndarray:
    """An n x n matrix from a text file, n one of `sizes`; its numbers may be inf or NaN.

    Raises:
        InputError: the file is missing or is no such matrix.
    """
    wanted = " or ".join(f"{size}x{size}" for size in sizes)
    with open_regular(path, f"write the {wanted} matrix there as text") as file:
        try:
            data = file.read(MAX_BYTES + 1)
        except OSError as error:
            raise InputError(f"{path} cannot be read ({error.strerror}); check the file") from error
    if len(data) > MAX_BYTES:
        raise InputError(
            f"{path} has more than {MAX_BYTES >> 10} KiB, too large for a {wanted} matrix; replace the file"
        )
    try:
        lines = (line.partition("#")[0] for line in data.decode("utf-8-sig").splitlines())
        numbers = [float(word) for line in lines for word in line.replace(",", " ").split()]
    except ValueError as error:
        raise InputError(f"{path} holds something that is no number; write a {wanted} matrix as text") from error
    for size in sizes:
        if len(numbers) == size * size:
            return np.array(numbers, dtype=np.float64).reshape(size, size)
    raise InputError(f"{path} holds {len(numbers)} numbers; write a {wanted} matrix")
