"""Features of photos and their matches by pycolmap; poses play no part."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from urllib.parse import quote

import cv2
import numpy as np

from room2dgs.captures.scene import Frame
from room2dgs.colmap import pycolmap
from room2dgs.config import PointsConfig
from room2dgs.cores import available_cores
from room2dgs.files import check_room
from room2dgs.geometry.camera import Camera
from room2dgs.sfm.features import extract_each

# On several threads of a busy machine pycolmap now and then finds other matches; separate calls in separate threads do
# so, too.
MATCHING_THREADS = 1
# Looser than COLMAP's 0.8: the known poses sort out wrong matches. A tenth more points, no less exact.
MAX_RATIO = 0.9
# Room in the database: pixels that a feature takes at least, its bytes, and the share of them that a pair matches.
FEATURE_PIXELS, FEATURE_BYTES, MATCHED = 16, 160, 0.3

IndexPairs = Sequence[tuple[int, int]]


@dataclass(frozen=True)
class Matches:
    """SIFT features of photos and their matches, in pycolmap's database.

    Attributes:
        frames: the photos.
        image_ids: of each in the database.
        images, database: where they lie.
        keypoints: of each photo, (F, 2) float64 pixels with centres at +0.5.
        of_pair: (i, j) of the matched photos -> (M, 2) uint32, a feature of each; pairs without a match are missing.
    """

    frames: tuple[Frame, ...]
    image_ids: tuple[int, ...]
    images: Path
    database: Path
    keypoints: tuple[np.ndarray, ...]
    of_pair: dict[tuple[int, int], np.ndarray]

    @property
    def photos(self) -> Path:
        """The capture's folder of photos, for what is said about them."""
        return self.frames[0].color_path.parent

    def pixels(self, pair: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
        """(M, 2) matched pixels in each of both photos."""
        matches = self.of_pair[pair]
        return self.keypoints[pair[0]][matches[:, 0]], self.keypoints[pair[1]][matches[:, 1]]


def match(
    frames: Sequence[Frame],
    pairs: IndexPairs,
    config: PointsConfig,
    work: Path,
    extracted: Callable[[], None] = lambda: None,
) -> Matches:
    """Extract and match, on the CPU. The result does not depend on threads, nor on what else the machine does.

    Args:
        frames: at their working size.
        pairs: (i, j) of the frames to match.
        work: a folder for images and database; the caller removes it.
        extracted: called between extraction, which uses all cores, and matching, which uses one.
    """
    images, database = work / "images", work / "database.db"
    with quiet():
        image_ids = _register(frames, images, database)
        check_room(work, database_bytes([frame.camera.size for frame in frames], len(pairs), config.max_features))
        masks = _written_masks(frames, work / "masks")
        _extract(images, database, [image_name(frame) for frame in frames], masks, config)
        extracted()
        _match(frames, pairs, database, work / "pairs.txt")
    with pycolmap.Database.open(database) as db:
        keypoints = tuple(db.read_keypoints(image_id)[:, :2].astype(np.float64) for image_id in image_ids)
        found = {(i, j): db.read_matches(image_ids[i], image_ids[j]) for i, j in pairs}
    of_pair = {pair: matches for pair, matches in found.items() if len(matches)}
    return Matches(tuple(frames), tuple(image_ids), images, database, keypoints, of_pair)


def of_photos(matches: Matches, pairs: IndexPairs, kept: Sequence[int]) -> tuple[Matches, list[tuple[int, int]]]:
    """The matches and pairs of some of the photos, which are numbered anew.

    Args:
        kept: their numbers, rising.
    """
    new = {old: number for number, old in enumerate(kept)}

    def numbered(pair: tuple[int, int]) -> tuple[int, int] | None:
        return (new[pair[0]], new[pair[1]]) if pair[0] in new and pair[1] in new else None

    found = {two: matches.of_pair[pair] for pair in matches.of_pair if (two := numbered(pair))}
    fewer = replace(
        matches,
        frames=tuple(matches.frames[index] for index in kept),
        image_ids=tuple(matches.image_ids[index] for index in kept),
        keypoints=tuple(matches.keypoints[index] for index in kept),
        of_pair=found,
    )
    return fewer, [two for pair in pairs if (two := numbered(pair))]


def database_bytes(sizes: Iterable[tuple[int, int]], pairs: int, features: int) -> int:
    """How much room a database of features and matches takes at most, with what SQLite writes before it is in there.

    Args:
        sizes: of the photos, pixels.
        features: the most of a photo.
    """
    most = [min(features, width * height // FEATURE_PIXELS) for width, height in sizes]
    matches = 2 * 8 * pairs * max(most, default=0) * MATCHED  # all, and those that one geometry explains
    return int(2 * (FEATURE_BYTES * sum(most) + matches)) + (1 << 20)


@contextmanager
def quiet(errors: bool = True) -> Iterator[None]:
    """Only pycolmap's errors reach the terminal; without `errors` not even these."""
    level = pycolmap.logging.minloglevel
    pycolmap.logging.minloglevel = int(pycolmap.logging.Level.ERROR if errors else pycolmap.logging.Level.FATAL)
    try:
        yield
    finally:
        pycolmap.logging.minloglevel = level


def image_name(frame: Frame) -> str:
    """Of the frame in the database: without spaces, which part COLMAP's list of pairs, and unlike any other's."""
    name = quote(frame.name, safe="") if re.search(r"[\s%#]", frame.name) else frame.name
    return f"{name}.bmp"  # written and read in a tenth of the time that a PNG takes


def pinhole(camera: Camera) -> pycolmap.Camera:
    """Size and intrinsics as pycolmap has them."""
    K = camera.K
    return pycolmap.Camera(
        model="PINHOLE", width=camera.width, height=camera.height, params=[K[0, 0], K[1, 1], K[0, 2], K[1, 2]]
    )


def epipolar_error(first: Camera, second: Camera, first_px: np.ndarray, second_px: np.ndarray) -> np.ndarray:
    """Sampson distance of matched pixels from the epipolar geometry of two posed cameras.

    Args:
        first_px, second_px: (M, 2) matched pixels.

    Returns:
        (M,) float64, pixels.
    """
    second_from_first = second.cam_from_world @ first.world_from_cam
    essential = pycolmap.essential_matrix_from_pose(pycolmap.Rigid3d(second_from_first[:3]))
    fundamental = np.linalg.inv(second.K).T @ essential @ np.linalg.inv(first.K)
    return np.sqrt(pycolmap.compute_squared_sampson_error(first_px, second_px, fundamental))


def essential_inliers(
    first: Camera, second: Camera, first_px: np.ndarray, second_px: np.ndarray, options: pycolmap.RANSACOptions
) -> np.ndarray:
    """(M,) bool: inliers among matched pixels (M, 2) of one essential matrix, whatever the poses."""
    found = pycolmap.estimate_essential_matrix(first_px, second_px, pinhole(first), pinhole(second), options)
    return np.zeros(len(first_px), bool) if found is None else np.asarray(found["inlier_mask"], bool)


def epipolar_inlier_share(
    matches: Matches, cameras: Sequence[Camera], pairs: Iterable[tuple[int, int]], max_px: float
) -> float:
    """Share of the pairs' matches within `max_px` of the epipolar lines of posed cameras; 0 without any."""
    total = near = 0
    for i, j in pairs:
        if (i, j) in matches.of_pair:
            error = epipolar_error(cameras[i], cameras[j], *matches.pixels((i, j)))
            total, near = total + len(error), near + int(np.count_nonzero(error <= max_px))
    return near / max(total, 1)


def _register(frames: Sequence[Frame], images: Path, database: Path) -> list[int]:
    """Write the working-size photos and enter them in order, so that ids do not depend on threads.

    Returns:
        The database's image id of each frame.
    """
    images.mkdir(parents=True)
    camera_ids: dict[bytes, int] = {}
    image_ids = []
    with pycolmap.Database.open(database) as db:
        for frame in frames:
            bgr = cv2.cvtColor(frame.color(), cv2.COLOR_RGB2BGR)
            path = images / image_name(frame)
            if not cv2.imwrite(str(path), bgr):
                raise OSError(f"{path} cannot be written; is the disk full?")
            camera = pinhole(frame.camera)
            key = camera.params.tobytes() + bytes(f"{camera.width}x{camera.height}", "ascii")
            if key not in camera_ids:
                camera_ids[key] = db.write_camera(camera)
                rig = pycolmap.Rig()
                rig.add_ref_sensor(pycolmap.sensor_t(pycolmap.SensorType.CAMERA, camera_ids[key]))
                db.write_rig(rig)
            image_ids.append(db.write_image(pycolmap.Image(name=path.name, camera_id=camera_ids[key])))
    return image_ids


def _written_masks(frames: Sequence[Frame], folder: Path) -> Path | None:
    """The folder with a mask for each photo, under the names that COLMAP looks for; None: no photo has one.

    Where there is a folder, COLMAP passes over photos without a mask: they get one that hides nothing.
    """
    if all(frame.mask() is None for frame in frames):
        return None
    folder.mkdir()
    for frame in frames:
        mask = frame.mask()
        white = np.full((frame.camera.height, frame.camera.width), 255, np.uint8)
        path = folder / f"{image_name(frame)}.png"
        if not cv2.imwrite(str(path), white if mask is None else mask.astype(np.uint8) * 255):
            raise OSError(f"{path} cannot be written; is the disk full?")
    return folder


def _extract(images: Path, database: Path, names: Sequence[str], masks: Path | None, config: PointsConfig) -> None:
    options = pycolmap.FeatureExtractionOptions()
    options.sift.max_num_features = config.max_features
    options.sift.peak_threshold = config.peak_threshold
    reader = pycolmap.ImageReaderOptions()
    if masks is not None:
        reader.mask_path = masks
    extract_each(database, images, names, options, available_cores(), reader)


def _match(frames: Sequence[Frame], pairs: IndexPairs, database: Path, list_path: Path) -> None:
    lines = [f"{image_name(frames[i])} {image_name(frames[j])}" for i, j in pairs]
    list_path.write_text("\n".join(lines), encoding="utf-8")
    options = pycolmap.FeatureMatchingOptions()
    options.num_threads = MATCHING_THREADS
    options.sift.max_ratio = MAX_RATIO
    options.skip_geometric_verification = True
    pycolmap.match_image_pairs(
        database,
        matching_options=options,
        pairing_options=pycolmap.ImportedPairingOptions(match_list_path=list_path),
        device=pycolmap.Device.cpu,
    )
