"""Frames and scenes, the same for all layouts."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np

from room2dgs.captures.cache import Cache
from room2dgs.captures.capture import C2W_OPENCV, Poses
from room2dgs.captures.depth_maps import DepthMap, depth_file
from room2dgs.captures.image_files import resized, whole_at
from room2dgs.captures.lens import Lens, pinhole_of
from room2dgs.captures.levelled import RGBGains, levelled
from room2dgs.captures.mask_images import OPAQUE, MaskRule, Masks, alpha_of, facts_of, mask_image, rule_of
from room2dgs.captures.photos import Photo, PhotoFile
from room2dgs.captures.point_cloud import PointCloud
from room2dgs.captures.world_offset import AT_ORIGIN, Origin
from room2dgs.errors import InputError
from room2dgs.geometry.camera import Camera


@dataclass(frozen=True)
class Frame:
    """One posed photo; pixels are read when asked for, at the size of `camera`.

    Attributes:
        name: unique in the scene, fit for a file's name ("000012"): files of the photo are called by it.
        camera: pose and intrinsics at the working image size, without distortion.
        color_path: the photo's file, or what it would be called as one.
        depth_path: depth map that a sensor measured, or the file that holds it; None without one.
        depth_unit_m: metres of one unit of the depth file (0.001 for millimetres).
        cache: where the decoded photo is kept; None: it is decoded each time.
        index: place in the capture's order.
        photo: the photo where it is no file of its own, or is turned; None: `color_path`.
        lens: the distortion that is taken out on reading; None: none.
        mask_photo: white where the photo may be used, of the photo's shape; None: everywhere.
        masks: of the capture, which tell what the mask's numbers mean; None: this one tells.
        transparent: the photo has an alpha, and what it hides may not be used either.
        depth_map: how the depth is read, and its camera; None: a 16-bit image registered to the photo.
        poses: what the pose on disk was read as (`scene.poses`).
        shares_stem: another photo of the capture has the same file name in another folder, or with another ending, so
            that a file called by it could be of either.
        gains: how many times as bright the photo's levels of red, green and blue are as they would be at the capture's
            mean exposure and white balance (`exposure`); None: unknown, or the same.
    """

    name: str
    camera: Camera
    color_path: Path
    depth_path: Path | None = None
    depth_unit_m: float = 0.001
    cache: Cache | None = field(default=None, repr=False, compare=False)
    index: int = 0
    photo: Photo | None = None
    lens: Lens | None = None
    mask_photo: Photo | None = None
    depth_map: DepthMap | None = None
    poses: Poses = C2W_OPENCV
    masks: Masks | None = field(default=None, repr=False, compare=False)
    transparent: bool = False
    shares_stem: bool = False
    gains: RGBGains | None = None

    @property
    def source(self) -> Photo:
        """The photo as it is stored."""
        return self.photo or PhotoFile(self.color_path)

    def full_size(self) -> tuple[int, int]:
        """(width, height) of the undistorted photo.

        Raises:
            InputError: the file cannot be decoded.
        """
        return pinhole_of(self.lens).size if self.lens else self.source.size()

    def color(self) -> np.ndarray:
        """(H, W, 3) uint8 RGB, undistorted, area-averaged down to the camera's size.

        It is shared with the cache: do not write to it.

        Raises:
            InputError: the file cannot be decoded.
        """
        if self.cache is None:
            return self._color()
        return self.cache.get_or(("photo", self.place, self.camera.size), lambda: (self._color(),))[0]

    def levelled_color(self) -> np.ndarray:
        """`color`, as it would be at the capture's mean exposure and white balance."""
        return self.color() if self.gains is None else levelled(self.color(), self.gains)

    def exposed(self, color: np.ndarray) -> np.ndarray:
        """(H, W, 3) float colours 0..1 at the capture's mean exposure, as they are in this photo."""
        return color if self.gains is None else np.clip(color * np.array(self.gains, color.dtype), 0, 1)

    def mask(self) -> np.ndarray | None:
        """(H, W) bool: pixels that may be used, those of which every part may; None: all may.

        It is shared with the cache: do not write to it.

        Raises:
            InputError: the file cannot be decoded.
        """
        whole = self.lens is None or pinhole_of(self.lens).valid is None
        if self.mask_photo is None and whole and not self.transparent:
            return None
        if self.cache is None:
            return self._mask()
        bits = self.cache.get_or(("mask", self.place, self.camera.size), self._mask_bits)[0]
        return np.unpackbits(bits, axis=1, count=self.camera.width).astype(bool) if bits.size else None

    def depth(self) -> np.ndarray | None:
        """(H, W) float32 z-depth in metres, 0 = invalid, at the camera's size (`depth_at`).

        None without a file.

        Raises:
            InputError: the file cannot be decoded.
        """
        if self.depth_path is None:
            return None
        if self.depth_map is not None:
            return self.depth_map.seen_by(self.camera, self.lens)
        return depth_file(self.depth_path, self.depth_unit_m).seen_by(self.camera, None)

    def digest(self) -> bytes:
        """Stands for the photo's content, what is taken out of it, and its mask."""
        parts = [self.source.digest()]
        if self.lens is not None:
            parts.append(repr((self.lens.model, self.lens.params, self.lens.size)).encode())
        if self.mask_photo is not None:
            parts.append(self.mask_photo.digest())
            if self._mask_rule != MaskRule():
                parts.append(repr(self._mask_rule).encode())
        return parts[0] if len(parts) == 1 else hashlib.sha256(b"".join(parts)).digest()

    @property
    def place(self) -> tuple:
        """What the pixels and the mask follow from, but for the camera's size: for keys of a cache."""
        return self.color_path, self.photo, self.lens, self.mask_photo, self.transparent

    def _color(self) -> np.ndarray:
        if self.lens is None:
            return self.source.pixels(self.camera.size)
        pixels = self.source.pixels()
        width, height = self.lens.known_size
        if pixels.shape[1::-1] != (width, height):
            raise InputError(f"{self.color_path} is not {width}x{height} pixels any more")
        return resized(pinhole_of(self.lens).undistorted(pixels), self.camera.size)

    @property
    def _mask_rule(self) -> MaskRule:
        if self.masks is not None:
            return self.masks.rule
        assert self.mask_photo is not None
        return rule_of([facts_of(mask_image(self.mask_photo))])

    def _mask_bits(self) -> tuple[np.ndarray]:
        mask = self._mask()
        return (np.zeros(0, np.uint8) if mask is None else np.packbits(mask, axis=1),)

    def _mask(self) -> np.ndarray | None:
        parts = [] if self.mask_photo is None else [self._mask_rule.usable(mask_image(self.mask_photo))]
        alpha = alpha_of(self.source) if self.transparent else None
        if alpha is not None:
            parts.append(alpha > OPAQUE)
        valid = pinhole_of(self.lens).valid if self.lens else None
        if not parts and valid is None:
            return None
        full = self.full_size()
        usable = np.ones(full[::-1], np.float32)
        for part in parts:
            stored = self.lens.known_size if self.lens else full
            white: np.ndarray = part.astype(np.float32)
            if white.shape[1::-1] != stored:
                white = cv2.resize(white, stored, interpolation=cv2.INTER_NEAREST)
            usable = usable * (pinhole_of(self.lens).undistorted(white) if self.lens else white)
        if valid is not None:
            usable = usable * valid
        return whole_at(usable, self.camera.size)


@dataclass(frozen=True)
class Dropped:
    """A frame that was left out, and why (one sentence for the log)."""

    name: str
    reason: str


@dataclass(frozen=True)
class Scene:
    """A capture: training and held-out views in capture order.

    Attributes:
        path: the capture's folder.
        train, test: disjoint views.
        dropped: frames on disk that cannot be used, with reasons.
        gt_mesh: ground-truth mesh in the capture's world, if there is one.
        cache: of all that is kept of the views.
        layout: of the capture on disk.
        metric: whether its lengths are metres.
        notes: what was found, and what was taken for what; a sentence each, for the log.
        warnings: what may be wrong with it and what mends that; a sentence each.
        given_points: reads the points that the capture brings, as its training views see them; None: it brings none.
        matched_only: names of training views whose depth and normals are not asked for: the keyframes are matched with
            them, and their photos are trained on.
        origin_m: where the origin of the poses and points stands in the capture's own world, metres: not (0, 0, 0) if
            that is far away (`world_offset`). `gt_mesh` is a file in that world.
        not_chosen: number of photos with a pose that `scene.frames` leaves aside.
        unit_m: metres of one unit of the capture's world, by which the scene was scaled (`in_metres`); None: it is as
            it was read. Files in the capture's world (`gt_mesh`, points.file) count in its unit then.
    """

    path: Path
    train: tuple[Frame, ...]
    test: tuple[Frame, ...]
    dropped: tuple[Dropped, ...] = field(default=())
    gt_mesh: Path | None = None
    cache: Cache = field(default_factory=Cache, repr=False, compare=False)
    layout: str = "scannet"
    metric: bool = True
    notes: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    given_points: Callable[[], PointCloud] | None = field(default=None, repr=False, compare=False)
    matched_only: frozenset[str] = frozenset()
    origin_m: Origin = AT_ORIGIN
    unit_m: float | None = None
    not_chosen: int = 0

    @property
    def frames(self) -> tuple[Frame, ...]:
        """Training and test views together, in capture order."""
        return tuple(sorted(self.train + self.test, key=lambda frame: (frame.index, frame.name)))

    @property
    def keyframes(self) -> tuple[Frame, ...]:
        """Training views that depth and normals are found of beforehand."""
        return tuple(frame for frame in self.train if frame.name not in self.matched_only)

    @property
    def beside(self) -> tuple[Frame, ...]:
        """The other training views."""
        return tuple(frame for frame in self.train if frame.name in self.matched_only)

    @property
    def extent(self) -> float:
        """Metres: 1.1 x the largest distance of a training camera from their mean (2DGS's scene radius)."""
        centres = np.stack([frame.camera.centre for frame in self.train])
        return 1.1 * float(np.linalg.norm(centres - centres.mean(axis=0), axis=1).max())
