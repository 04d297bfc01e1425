"""Similar photos by bags of visual words."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

WORDS = 512
SAMPLES = 20000  # descriptors that the words are made from
ROUNDS = 8


def similarity(count: int, descriptors: Callable[[int], np.ndarray]) -> np.ndarray:
    """(N, N) cosines between the photos' histograms of visual words, weighted by inverse frequency.

    The words are centres of these photos' own descriptors, so nothing has to be downloaded.

    Args:
        count: N photos.
        descriptors: of one photo, (F, 128) uint8.
    """
    words = _words(count, descriptors)
    counts = np.zeros((count, len(words)))
    for index in range(count):
        found = _unit(descriptors(index))
        if len(found):
            counts[index] = np.bincount((found @ words.T).argmax(axis=1), minlength=len(words))
    present = np.maximum((counts > 0).sum(axis=0), 1)
    weighed = np.sqrt(counts) * np.log1p(count / present)
    weighed /= np.maximum(np.linalg.norm(weighed, axis=1, keepdims=True), 1e-12)
    return weighed @ weighed.T


def _words(count: int, descriptors: Callable[[int], np.ndarray]) -> np.ndarray:
    """(W, 128) unit centres."""
    each = max(1, SAMPLES // count)
    parts = []
    for index in range(count):
        found = descriptors(index)
        parts.append(_unit(found[:: max(1, len(found) // each)][:each]))
    samples = np.concatenate(parts)
    words = samples[:: max(1, len(samples) // WORDS)][:WORDS].copy()
    for _ in range(ROUNDS):
        nearest = (samples @ words.T).argmax(axis=1)
        sums = np.zeros_like(words)
        np.add.at(sums, nearest, samples)
        used = np.bincount(nearest, minlength=len(words)) > 0
        words[used] = _unit(sums[used])
    return words


def _unit(vectors: np.ndarray) -> np.ndarray:
    vectors = np.asarray(vectors, np.float32).reshape(-1, 128)
    return vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-6)
