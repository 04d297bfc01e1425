"""Features and verified matches of photos without poses, by pycolmap, in a database that survives a kill."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from room2dgs.captures.capture import pinhole_lens
from room2dgs.captures.principal_point import check_principal_point
from room2dgs.colmap import pycolmap
from room2dgs.config import PrepareConfig
from room2dgs.cores import available_cores
from room2dgs.files import check_room, whole_file
from room2dgs.logs import Log
from room2dgs.prepare.photos import ChosenPhoto
from room2dgs.prepare.progress import Progress
from room2dgs.sfm.features import extract_each
from room2dgs.sfm.matching import MATCHING_THREADS, IndexPairs, database_bytes, quiet

PAIRS_AT_ONCE = 60
# Of the longer side; phones' main cameras have 0.7 to 0.9. It is estimated with the poses; this is where it starts.
FOCAL = 0.85
SEED = 0
PLAIN = re.compile(r"[\w.-]+")
KINDS = pycolmap.TwoViewGeometryConfiguration


def new_database(
    path: Path, photos: Sequence[ChosenPhoto], config: PrepareConfig, intrinsics: Sequence[float] | None, half: bool
) -> None:
    """A database that knows photos and cameras; image ids are 1, 2, ... in the order of the photos.

    Photos of one size and one focal length in EXIF share a camera.

    Args:
        intrinsics: fx, fy, cx, cy of a pinhole camera in pixels of the photos; None: unknown.
        half: their cx, cy count pixel centres at +0.5; False: at integers.
    """
    path.unlink(missing_ok=True)
    with whole_file(path) as temporary, pycolmap.Database.open(temporary) as database:
        camera_ids: dict[tuple, int] = {}
        for photo in photos:
            key = (photo.size, photo.focal_px)
            if key not in camera_ids:
                camera_ids[key] = database.write_camera(_camera(photo, config, intrinsics, half))
                rig = pycolmap.Rig()
                rig.add_ref_sensor(pycolmap.sensor_t(pycolmap.SensorType.CAMERA, camera_ids[key]))
                database.write_rig(rig)
            database.write_image(pycolmap.Image(name=photo.name, camera_id=camera_ids[key]))


def _camera(
    photo: ChosenPhoto, config: PrepareConfig, intrinsics: Sequence[float] | None, half: bool
) -> pycolmap.Camera:
    width, height = photo.size
    if intrinsics is not None:
        fx, fy, cx, cy = intrinsics
        lens = pinhole_lens(fx, fy, cx, cy, photo.size, "scene.intrinsics", half)
        check_principal_point(lens)  # of a video whose frames were made smaller they are not
        camera = pycolmap.Camera(model="PINHOLE", width=width, height=height, params=list(lens.params))
        camera.has_prior_focal_length = True
        return camera
    focal = photo.focal_px or FOCAL * max(photo.size)
    camera = pycolmap.Camera.create_from_model_name(0, config.lens, focal, width, height)
    camera.has_prior_focal_length = photo.focal_px is not None
    return camera


def set_focal(path: Path, photos: Sequence[ChosenPhoto], share: float) -> None:
    """Cameras start with this share of their longer side; those whose EXIF tells it start with that.

    Pairs are not verified anew, so this leaves what is matched as it is.
    """
    known = {index: photo.focal_px for index, photo in enumerate(photos, 1)}
    with pycolmap.Database.open(path) as database:
        exif = {image.camera_id: known.get(image.image_id) for image in database.read_all_images()}
        for camera in database.read_all_cameras():
            focal = exif.get(camera.camera_id) or share * max(camera.width, camera.height)
            params = np.array(camera.params)
            params[list(camera.focal_length_idxs())] = focal
            camera.params = params.tolist()
            database.update_camera(camera)


def extracted(path: Path, images: Path, photos: Sequence[ChosenPhoto], config: PrepareConfig, log: Log) -> list[int]:
    """Features of all photos; those that are there already stay.

    Returns:
        The number of each photo's.
    """
    with pycolmap.Database.open(path) as database:
        missing = [photo.name for index, photo in enumerate(photos, 1) if not database.exists_descriptors(index)]
    if missing:
        log(f"features: {len(missing)} of {len(photos)} photos")
    options = pycolmap.FeatureExtractionOptions()
    options.sift.max_num_features = config.features
    options.sift.peak_threshold = config.peak_threshold
    options.max_image_size = config.feature_side
    sizes = {photo.name: photo.size for photo in photos}
    check_room(path.parent, database_bytes([sizes[name] for name in missing], 0, config.features))
    progress = Progress(log, "features", len(missing), "photos")
    with quiet():
        extract_each(path, images, missing, options, config.threads or available_cores(), done=progress.at)
    with pycolmap.Database.open(path) as database:
        return [database.num_keypoints_for_image(index) for index in range(1, len(photos) + 1)]


def matched(
    path: Path, photos: Sequence[ChosenPhoto], pairs: IndexPairs, work: Path, config: PrepareConfig, log: Log
) -> None:
    """Match some pairs and keep the matches that one epipolar geometry or homography explains.

    Pairs that are there already stay. The random draws have one seed: the result does not depend on threads.
    """
    names = [photo.name for photo in photos]
    _rename(path, names)  # after a kill below they are numbers
    with pycolmap.Database.open(path) as database:
        missing = [(i, j) for i, j in pairs if not _is_verified(database, i + 1, j + 1)]
    if missing:
        log(f"matching: {len(missing)} pairs")
    matching, verification = pycolmap.FeatureMatchingOptions(), pycolmap.TwoViewGeometryOptions()
    matching.num_threads = MATCHING_THREADS
    verification.ransac.random_seed = SEED
    pairing = pycolmap.ImportedPairingOptions(match_list_path=work / "pairs.txt")
    check_room(path.parent, database_bytes([photo.size for photo in photos], len(missing), config.features))
    progress = Progress(log, "matching", len(missing), "pairs")
    # the list of pairs is parted by spaces
    plain = [name if PLAIN.fullmatch(name) else f"photo-{index}" for index, name in enumerate(names)]
    with quiet(), _renamed(path, plain, names):
        for start in range(0, len(missing), PAIRS_AT_ONCE):
            lines = [f"{plain[i]} {plain[j]}" for i, j in missing[start : start + PAIRS_AT_ONCE]]
            (work / "pairs.txt").write_text("\n".join(lines), encoding="utf-8")
            pycolmap.match_image_pairs(path, matching, pairing, verification, device=pycolmap.Device.cpu)
            progress.at(min(start + PAIRS_AT_ONCE, len(missing)))


@contextmanager
def _renamed(path: Path, names: Sequence[str], before: Sequence[str]) -> Iterator[None]:
    """The database's photos by other names."""
    if list(names) == list(before):
        yield
        return
    _rename(path, names)
    try:
        yield
    finally:
        _rename(path, before)


def _rename(path: Path, names: Sequence[str]) -> None:
    with pycolmap.Database.open(path) as database:
        for index, name in enumerate(names, 1):
            image = database.read_image(index)
            if image.name != name:
                image.name = name
                database.update_image(image)


def _is_verified(database: pycolmap.Database, first: int, second: int) -> bool:
    return database.exists_matches(first, second) and database.exists_two_view_geometry(first, second)


def descriptors(path: Path, index: int) -> np.ndarray:
    """(F, 128) uint8 of a photo."""
    with pycolmap.Database.open(path) as database:
        return np.asarray(database.read_descriptors(index + 1).data)


def verified_pairs(path: Path) -> dict[tuple[int, int], tuple[int, str]]:
    """(i, j) with i < j -> number of matches that hold, and what explains them ("PANORAMIC", ...)."""
    with pycolmap.Database.open(path) as database:
        ids, geometries = database.read_two_view_geometries()
    found = {}
    for pair_id, geometry in zip(ids, geometries, strict=True):
        first, second = sorted(pycolmap.pair_id_to_image_pair(pair_id))
        found[first - 1, second - 1] = len(geometry.inlier_matches), KINDS(geometry.config).name
    return found
