"""Which frames of a video and which pairs of photos are used."""

from __future__ import annotations

from types import SimpleNamespace

import cv2
import numpy as np

from room2dgs.prepare.choice import LEAST, chosen_frames
from room2dgs.prepare.loose import loose_photos
from room2dgs.prepare.motion import JUMP, Motion, filled
from room2dgs.prepare.pairs import loop_pairs, sequential_pairs
from room2dgs.prepare.sharpness import sharpness
from room2dgs.prepare.similar import similarity


def texture(seed: int = 0, size: tuple[int, int] = (240, 480)) -> np.ndarray:
    noise = np.random.default_rng(seed).normal(size=size).astype(np.float32)
    return np.clip(128 + 60 * cv2.GaussianBlur(noise, (0, 0), 1.5) / 0.19, 0, 255).astype(np.uint8)


def test_blur_in_one_direction_is_seen_at_any_contrast():
    sharp = texture()
    across, down = cv2.blur(sharp, (9, 1)), cv2.blur(sharp, (1, 9))
    assert max(sharpness(across), sharpness(down)) < 0.7 * sharpness(sharp)
    assert abs(sharpness((sharp // 4 + 100).astype(np.uint8)) - sharpness(sharp)) < 0.1


def test_motion_is_a_share_of_the_width_and_a_cut_is_a_jump():
    wide, motion = texture(), Motion()
    assert motion.step(wide[:, :320]) == 0.0
    assert abs(motion.step(wide[:, 16:336]) - 0.05) < 0.003
    assert motion.step(texture(1)[:, :320]) == JUMP
    assert np.isnan(Motion().step(np.full((48, 64), 90, np.uint8))) is np.False_
    blank = Motion()
    blank.step(np.full((48, 64), 90, np.uint8))
    assert np.isnan(blank.step(wide[:, :320]))
    assert filled(np.array([0.0, np.nan, 0.2])).tolist() == [0.0, 0.1, 0.2]


def test_the_sharpest_frames_are_taken_at_even_steps_and_standing_still_gives_one():
    steps = np.full(400, 0.01)
    steps[200:] = 0.0  # stands still
    sharp = np.random.default_rng(0).uniform(0.5, 0.6, 400)
    sharp[np.arange(4, 400, 8)] = 0.9
    chosen = chosen_frames(sharp, steps, 0.08, 100)
    assert len(chosen) in (25, 26)
    gaps = np.diff(chosen[:-1])
    assert gaps.min() >= 3 and gaps.max() <= 13
    assert sharp[chosen].mean() > 0.75  # 0.59 of all
    assert len(chosen_frames(sharp, steps, 0.08, 10)) == 10
    assert len(chosen_frames(sharp, steps / 50, 0.08, 100)) == LEAST  # an orbit moves the picture little


def test_sequential_pairs_reach_ahead_and_loops_come_back():
    pairs = sequential_pairs(100, 3)
    assert {(0, 1), (0, 3), (0, 6), (0, 48), (98, 99)} <= set(pairs) and (0, 4) not in pairs
    rng = np.random.default_rng(0)
    places = [rng.integers(0, 256, (300, 128)).astype(np.uint8) for _ in range(6)]
    walk = [*places, places[1][:200]]  # back where the second photo was taken
    looks = similarity(len(walk), lambda index: walk[index])
    assert looks[6, 1] > 2 * np.delete(looks[6], [1, 6]).max()
    assert (1, 6) in loop_pairs(looks, 1, 2)
    assert (5, 6) not in loop_pairs(looks, 3, 2)  # neighbours are matched anyway


def test_photos_that_only_hang_on_each_other_are_loose():
    """A chain of ten; a far room behind a door; a photo with few points that all others know; two of a blank wall."""
    tracks = [[i, i + 1, i + 2] for i in range(1, 9) for _ in range(60)]
    tracks += [[i, i + 1, i + 2] for i in range(21, 29) for _ in range(200)]  # much that is seen there alone
    tracks += [[9, 10, 21] for _ in range(70)]  # through the door
    tracks += [[3, 4, 31] for _ in range(24)]
    tracks += [[41, 42] for _ in range(46)] + [[41, i] for i in range(1, 9) for _ in range(4)] + [[1, 2, 42]] * 10

    def point(track):
        return SimpleNamespace(track=SimpleNamespace(elements=[SimpleNamespace(image_id=i) for i in track]))

    model = SimpleNamespace(
        points3D={number: point(track) for number, track in enumerate(tracks)},
        reg_image_ids=lambda: {*range(1, 11), *range(21, 31), 31, 41, 42},
    )
    assert loose_photos(model) == [41, 42]
