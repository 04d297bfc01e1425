"""The photos of a capture without poses: chosen from a video or a folder, and written side by side."""

from __future__ import annotations

import math
import os
import re
import shutil
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from PIL import Image, ImageOps

from room2dgs.captures.exif import EXIF_BLOCK, exif_focal_px
from room2dgs.captures.image_files import color_size, read_photo
from room2dgs.captures.left_out import left_out, some
from room2dgs.captures.listing import PHOTO_SUFFIXES, photos_in, unread_photos
from room2dgs.captures.mask_files import mask_folders
from room2dgs.captures.opened_images import opened_image
from room2dgs.captures.unmatched import called_map
from room2dgs.captures.video import open_video
from room2dgs.config import PrepareConfig
from room2dgs.errors import InputError
from room2dgs.files import whole_folder
from room2dgs.logs import Log
from room2dgs.prepare.choice import chosen_frames
from room2dgs.prepare.motion import Motion, filled
from room2dgs.prepare.progress import Progress
from room2dgs.prepare.sharpness import sharpness
from room2dgs.prepare.stage_cache import StageCache, key_of
from room2dgs.regular_files import check_regular

LEAST_PHOTOS = 5
UNREAD = "photos that cannot be read"
LEAST_WAY = 0.15  # of the picture, in its widths
BLURRED = 0.22  # sharpness that half of the photos stay below; with 11 pixels of motion in 640 they do (sharp: 0.35)
MOST_SIZES = 4  # of photos in one folder; upright and lying ones count as one
JPEG = [cv2.IMWRITE_JPEG_QUALITY, 97, cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444]
ORIENTATION = 0x0112
SUBFOLDERS = ("images", "rgb", "color")
CALLED_MAP = re.compile(r"[^a-z0-9]*(masks?|depths?)[^a-z0-9]*", re.IGNORECASE)


@dataclass(frozen=True)
class ChosenPhoto:
    """A photo that goes into the reconstruction.

    Attributes:
        name: of its file.
        size: (width, height).
        focal_px: as its EXIF has it; None: unknown.
        seconds: of the video; None for photos.
        index: frame of the video, or place in the folder.
        sharpness: 0..1.
    """

    name: str
    size: tuple[int, int]
    focal_px: float | None
    seconds: float | None
    index: int
    sharpness: float


def choose_photos(config: PrepareConfig, folder: Path, stages: StageCache, log: Log) -> tuple[list[ChosenPhoto], str]:
    """Choose the photos and write them.

    Args:
        folder: where they go.

    Returns:
        The photos in the order in which they were taken, and a key of all that they depend on.

    Raises:
        InputError: what was given cannot be read, or is too little.
    """
    chosen_by = (config.max_photos, config.spacing, config.max_side)
    if config.video:
        path = Path(config.video)
        if not os.path.lexists(path):
            raise InputError(f"{path} is not there; give video=FILE")
        check_regular(path, "give video=FILE")
        key = key_of("video", str(path), path.stat().st_size, path.stat().st_mtime_ns, *chosen_by)
    else:
        assert config.images is not None  # the settings have one of the two
        path = _photo_folder(Path(config.images))
        unread = unread_photos(path)
        if unread:
            log(f"NOTE: {unread}")
        names, lines = _photos_and_maps(path)
        for line in lines:
            log(f"NOTE: {line}")
        state = [(name, size, (path / name).stat().st_mtime_ns) for name, size in _regular(path, names)[0].items()]
        key = key_of("images", str(path), state, *chosen_by[:1])
    known = stages.found("photos", key)
    if known is None or any(not (folder / photo["name"]).is_file() for photo in known["photos"]):
        photos = (
            _from_video(path, config, folder, stages, log) if config.video else _from_folder(path, config, folder, log)
        )
        known = stages.finished("photos", key, {"photos": [vars(photo) for photo in photos]})
    else:
        log(f"photos: {len(known['photos'])} are there from before")
    return [ChosenPhoto(**{**photo, "size": tuple(photo["size"])}) for photo in known["photos"]], key


def _photo_folder(path: Path) -> Path:
    """Where the photos lie: the folder itself, or one of the usual names in it."""
    if not path.is_dir():
        raise InputError(f"{path} is no folder; give images=DIR of photos, or video=FILE")
    found = next((place for place in (path, *(path / name for name in SUBFOLDERS)) if photos_in(place)), None)
    if found is None:
        unread = next(
            (message for place in (path, *(path / name for name in SUBFOLDERS)) if (message := unread_photos(place))),
            None,
        )
        if unread:
            raise InputError(unread)
        raise InputError(f"{path} has no photos ({', '.join(PHOTO_SUFFIXES)}); give images=DIR of photos")
    return found


def _from_video(path: Path, config: PrepareConfig, folder: Path, stages: StageCache, log: Log) -> list[ChosenPhoto]:
    key = key_of("scan, times", str(path), path.stat().st_size, path.stat().st_mtime_ns)
    scan = stages.found("scan", key)
    if scan is None:
        scan = stages.finished("scan", key, _scanned(path, log))
    sharp, steps = np.array(scan["sharpness"]), filled(np.array(scan["steps"], float))
    seconds = np.array(scan["seconds"])
    chosen = chosen_frames(sharp, steps, config.spacing, config.max_photos)
    way = float(steps.sum())
    if len(sharp) < LEAST_PHOTOS:
        raise InputError(f"{path} has {len(sharp)} frames; a room takes a walk of half a minute or more")
    if way < LEAST_WAY or len(chosen) < LEAST_PHOTOS:
        raise InputError(
            f"{path} shows hardly any motion ({way:.2f} picture widths in {len(sharp)} frames), so no depth can be "
            "told from it; walk through the room while filming"
        )
    _check_blur(path, sharp[chosen])
    step = way / len(chosen)
    log(
        f"photos: {len(chosen)} of {len(sharp)} frames, the picture moves {step:.0%} of its width from one to the next "
        f"(sharpness {np.median(sharp[chosen]):.2f}, of all frames {np.median(sharp):.2f})"
    )
    if step > 0.2:
        log("NOTE: the frames are far apart and may not overlap enough; film slower, or raise prepare.max_photos")
    wanted = {int(index) for index in chosen}
    progress = Progress(log, "writing photos", len(wanted), "photos")
    photos = []
    with whole_folder(folder) as partial:
        for index, image, _ in _frames(path):
            if index not in wanted:
                continue
            photo = _at_most(image, config.max_side)
            name = f"frame_{index:06d}.jpg"
            if not cv2.imwrite(str(partial / name), photo, JPEG):
                raise OSError(f"{partial / name} cannot be written; is the disk full?")
            size = photo.shape[1::-1]
            photos.append(ChosenPhoto(name, size, None, float(seconds[index]), index, float(sharp[index])))
            progress.at(len(photos))
            if len(photos) == len(wanted):
                break
    return photos


def _at_most(image: np.ndarray, side: int) -> np.ndarray:
    scale = side / max(image.shape[:2])
    return cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA) if scale < 1 else image


def _scanned(path: Path, log: Log) -> dict[str, list]:
    """Sharpness, step and time of each frame."""
    capture = _opened(path)
    total = max(0, int(capture.get(cv2.CAP_PROP_FRAME_COUNT)))
    rate = capture.get(cv2.CAP_PROP_FPS)
    capture.release()
    if not (math.isfinite(rate) and rate > 0):
        rate = 30.0
    log(f"video: {path}, {total} frames, {rate:.0f} a second")
    motion, progress = Motion(), Progress(log, "looking for sharp frames", total or None, "frames")
    found: dict[str, list] = {"sharpness": [], "steps": [], "seconds": []}
    for index, image, shown in _frames(path):
        grey = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
        found["sharpness"].append(round(sharpness(grey), 5))
        step = motion.step(grey)
        found["steps"].append(round(step, 6) if math.isfinite(step) else None)
        found["seconds"].append(round(shown, 3))
        progress.at(index + 1)
    count = len(found["steps"])
    if not count:
        raise InputError(f"{path} has no frame that can be decoded; convert it to H.264 in .mp4")
    if not (np.diff(found["seconds"]) > 0).all():  # the file tells no times
        found["seconds"] = [round(index / rate, 3) for index in range(count)]
    if count < 0.9 * total:
        log(f"NOTE: {path} ends after {count} of {total} frames; copy it again if something is missing")
    return found


def _opened(path: Path) -> cv2.VideoCapture:
    return open_video(path, upright=True)


def _frames(path: Path):
    """(index, (H, W, 3) BGR, seconds when it is shown) of a video's frames, turned upright as its header says."""
    capture = _opened(path)
    try:
        index = 0
        while True:
            try:
                good, image = capture.read()
            except cv2.error:  # of a damaged frame
                return
            if not good:
                return
            yield index, image, capture.get(cv2.CAP_PROP_POS_MSEC) / 1000
            index += 1
    finally:
        capture.release()


def _photos_and_maps(path: Path) -> tuple[list[str], list[str]]:
    """Names of the photos in a folder, without masks and depth maps that lie among them, and notes on what is not used:
    these, and folders of masks.
    """
    names = photos_in(path)
    photos = {text for name in names for text in (name, Path(name).stem, name.partition(".")[0])}
    # "room_mask.png" is a photo, unless there is one called room
    maps = [name for name in names if called_map(name) and CALLED_MAP.sub("", Path(name).stem) in photos]
    notes = []
    if maps:
        notes.append(f"{len(maps)} files in {path} are called as masks or depth maps and are not used: {some(maps)}")
    for folder in mask_folders(dict.fromkeys((path, path.parent))):
        notes.append(
            f"{folder} is not used for the poses; for a run put it into the capture as masks/, its files named as the "
            "photos there"
        )
    return [name for name in names if name not in set(maps)], notes


def _regular(path: Path, names: list[str]) -> tuple[dict[str, int], dict[str, str]]:
    """Photos that are files, with their sizes in bytes, and those that are none, with the sentences that say so."""
    good: dict[str, int] = {}
    bad: dict[str, str] = {}
    for name in names:
        try:
            good[name] = check_regular(path / name, "delete it")
        except InputError as error:
            bad[name] = str(error)
    return good, bad


def _from_folder(path: Path, config: PrepareConfig, folder: Path, log: Log) -> list[ChosenPhoto]:
    all_names, _ = _photos_and_maps(path)
    names, bad = _regular(path, all_names)
    left_out(bad, len(all_names), UNREAD)  # too many of them are worse news than too few others
    if len(names) < LEAST_PHOTOS:
        raise InputError(f"{path} has {len(names)} photos, at least {LEAST_PHOTOS} are needed; take more of the room")
    progress = Progress(log, "looking at photos", len(names), "photos")
    found: dict[str, float] = {}
    for number, name in enumerate(names, start=1):
        try:
            found[name] = sharpness(cv2.cvtColor(read_photo(path / name, None), cv2.COLOR_RGB2GRAY))
        except InputError as error:
            bad[name] = str(error)
        progress.at(number)
    if told := left_out(bad, len(all_names), UNREAD):
        log(f"WARNING: {told} ({next(iter(bad.values()))})")
    taken = list(found)
    _check_sizes(path, taken)
    sharp = np.array(list(found.values()))
    chosen = chosen_frames(sharp, np.ones(len(taken)), 1.0, config.max_photos)
    _check_blur(path, sharp[chosen])
    log(f"photos: {len(chosen)} of {len(taken)} (sharpness {np.median(sharp[chosen]):.2f})")
    progress = Progress(log, "copying photos", len(chosen), "photos")
    photos: list[ChosenPhoto] = []
    source: dict[str, str] = {}
    with whole_folder(folder) as partial:
        for index in chosen:
            name, exif = _copied(path / taken[index], partial)
            if name in source:
                raise InputError(f"{path / source[name]} and {taken[index]} would both be {name}; rename one of them")
            source[name] = taken[index]
            size = color_size(partial / name)
            photos.append(ChosenPhoto(name, size, exif_focal_px(exif, size), None, int(index), float(sharp[index])))
            progress.at(len(photos))
    return photos


def _copied(path: Path, folder: Path) -> tuple[str, Image.Exif]:
    """Name of a photo's copy, upright, 8 bits, otherwise the same file; and the photo's EXIF."""
    upright = None
    with opened_image(path) as image:
        exif = image.getexif()
        turned = exif.get(ORIENTATION, 1) not in (0, 1)
        plain = image.mode in ("RGB", "L") and image.format in ("JPEG", "PNG")
        exif.get_ifd(EXIF_BLOCK)  # read while the file is open
        if turned and plain:
            upright = ImageOps.exif_transpose(image)
    if upright is not None:
        name = f"{path.stem}.jpg"
        upright.convert("RGB").save(folder / name, quality=97, subsampling=0, exif=upright.getexif())
    else:
        name = path.name if plain else f"{path.stem}.png"
        if plain:
            shutil.copyfile(path, folder / name)
        else:
            photo = Image.fromarray(read_photo(path, None))
            photo.getexif()[ORIENTATION] = exif.get(ORIENTATION, 1)
            ImageOps.exif_transpose(photo).save(folder / name)
    return name, exif


def _check_sizes(path: Path, names: list[str]) -> None:
    sizes = Counter(tuple(sorted(color_size(path / name))) for name in names)
    if len(sizes) > MOST_SIZES:
        some = ", ".join(f"{width}x{height}" for (height, width), _ in sizes.most_common(3))
        raise InputError(
            f"{path} has photos of {len(sizes)} sizes ({some}, ...), whose lenses cannot be told from each other; give "
            "photos as one camera wrote them, neither cropped nor resized"
        )


def _check_blur(path: Path, sharp: np.ndarray) -> None:
    typical = float(np.median(sharp))
    if typical < BLURRED:
        raise InputError(
            f"{path} is blurred all over (sharpness {typical:.2f} of 1, {BLURRED} is needed); film slower, "
            "with more light"
        )
