"""A walk through a made room as a phone films it: what of a capture's photos, poses and gains is the phone's."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from scipy.ndimage import gaussian_filter1d

from room2dgs.tools.phone_camera.effects import OF_PHOTO
from room2dgs.tools.phone_camera.motion import Motion, exposure_times, motions, moving_photo
from room2dgs.tools.phone_camera.phone import Phone, random_phone
from room2dgs.tools.phone_camera.photo import phone_photo
from room2dgs.tools.phone_camera.wander import of_light, wandering_gains
from room2dgs.tools.pose_drift import Drift, drifted
from room2dgs.tools.random_rooms.render import Room, shade

FOCUS_SMOOTH = 2.0  # photos over which the focus stays


@dataclass(frozen=True)
class Filming:
    """What the phone does on one walk of F photos; without an effect its part is as nothing happened.

    Attributes:
        phone, effects: which phone, and names of what it does.
        written: (F, 4, 4) poses as the phone's tracker has them.
        gains: (F, 3) factors of the levels.
        focal: (F,) factors of the focal length.
        motions: of each photo; exposure_s: (F,) seconds.
    """

    phone: Phone
    effects: frozenset[str]
    written: np.ndarray
    gains: np.ndarray
    focal: np.ndarray
    motions: list[Motion]
    exposure_s: np.ndarray

    def radiance(
        self, room: Room, index: int, focal: float, world_from_cam: np.ndarray, size: tuple[int, int], rng
    ) -> np.ndarray:
        """(H, W, 3) float32 light that falls on the sensor in one photo."""
        moved = partial(moving_photo, partial(shade, room, rng=rng), self.focal[index] * focal, world_from_cam)
        readout_s = self.phone.readout_s if "rolling" in self.effects else 0.0
        return moved(self.motions[index], size, self.exposure_s[index], readout_s)

    def photo(self, light: np.ndarray, index: int, seed: list[int]) -> np.ndarray:
        """(H, W, 3) uint8 photo of light, not yet compressed."""
        light = light * of_light(self.gains[index]).astype(np.float32)
        return phone_photo(light, seed, self.phone, (self.effects & OF_PHOTO.keys()) - {"jpeg"})

    def as_dict(self) -> dict[str, Any]:
        """The truth of each photo, for a file beside the capture."""
        return {
            "phone": vars(self.phone),
            "gains": np.round(self.gains, 6).tolist(),
            "focal": np.round(self.focal, 6).tolist(),
            "exposure_s": np.round(self.exposure_s, 6).tolist(),
        }


def filming(effects: frozenset[str], poses: np.ndarray, rng: np.random.Generator) -> Filming:
    """Draws a phone and what it does on a walk; each effect is the same whichever others there are.

    Args:
        poses: (F, 4, 4) world_from_cam of the walk.
    """
    of_phone, of_gains, of_focus, of_hand, of_exposure, of_drift = rng.spawn(6)
    phone, photos = random_phone(of_phone), len(poses)
    gains, focal, exposure = np.ones((photos, 3)), np.ones(photos), np.zeros(photos)
    if "wander" in effects:
        gains = wandering_gains(photos, phone.wander, of_gains)
    if "breathing" in effects:
        focus = gaussian_filter1d(of_focus.uniform(-1, 1, photos), FOCUS_SMOOTH)
        focal = 1 + phone.breathing * focus / np.abs(focus).max()
    if "blur" in effects:
        exposure = exposure_times(photos, phone.exposure_s, of_exposure)
    written = drifted(poses, Drift(), of_drift)[0] if "drift" in effects else poses
    return Filming(phone, effects, written, gains, focal, motions(poses, of_hand), exposure)
