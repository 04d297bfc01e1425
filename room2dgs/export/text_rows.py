"""Rows of numbers as text, all at once: a mesh of millions of faces is as many lines of an OBJ file."""

from __future__ import annotations

import numpy as np

ROWS = 200_000  # at a time
DROPPED = 0  # a byte that is not written


def text_rows(pattern: str, values: np.ndarray, decimals: int = 0) -> bytes:
    """A line for each row, `pattern` with its fields filled.

    Args:
        pattern: "v {} {} {}"; a field for each column, ASCII.
        values: (N, C) numbers below 9e18 / 10**decimals.
        decimals: behind the point, rounded half to even as by `format`; 0: whole numbers without a point.
    """
    texts = [np.frombuffer(text.encode("ascii"), np.uint8) for text in f"{pattern}\n".split("{}")]
    if len(texts) != values.shape[1] + 1:
        raise ValueError(f"{pattern!r} has {len(texts) - 1} fields for {values.shape[1]} columns")
    parts = (_part(texts, values[at : at + ROWS], decimals) for at in range(0, len(values), ROWS))
    return b"".join(parts)


def _part(texts: list[np.ndarray], values: np.ndarray, decimals: int) -> bytes:
    """The lines of some rows: characters in columns of even width, then all that are there in their order."""
    fields: list[np.ndarray] = []
    for text, column in zip(texts, values.T, strict=False):
        fields += [np.broadcast_to(text, (len(values), len(text))), _digits(column, decimals)]
    fields.append(np.broadcast_to(texts[-1], (len(values), len(texts[-1]))))
    characters = np.concatenate(fields, axis=1)
    return characters[characters != DROPPED].tobytes()


def _digits(column: np.ndarray, decimals: int) -> np.ndarray:
    """(N, W) uint8: sign, digits and point of each number, `DROPPED` where it has none."""
    whole = np.rint(np.asarray(column, np.float64) * 10**decimals).astype(np.int64) if decimals else column
    left = np.abs(whole).astype(np.int64)
    most = max(len(str(int(left.max(initial=0)))), decimals + 1)
    out = np.full((len(left), 1 + most + (decimals > 0)), DROPPED, np.uint8)
    out[:, 0] = np.where(whole < 0, ord("-"), DROPPED)
    at = out.shape[1] - 1
    for place in range(most):
        if decimals and place == decimals:
            out[:, at] = ord(".")
            at -= 1
        rest, digit = np.divmod(left, 10)
        shown = (left > 0) | (place <= decimals)
        out[:, at] = np.where(shown, digit + ord("0"), DROPPED)
        left, at = rest, at - 1
    return out
