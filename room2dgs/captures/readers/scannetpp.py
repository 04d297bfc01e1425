"""ScanNet++: a scene's DSLR photos (fisheye) or iPhone video, with the laser scan's mesh as ground truth.

Its COLMAP models are metric and in the frame of scans/mesh_aligned_0.05.ply; transforms.json, in axes of its own, is
read where they are missing. Masks hide what was made anonymous; train_test_lists.json is the split.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np

from room2dgs.captures.capture import C2W_OPENGL, W2C_OPENCV, Capture, Shot
from room2dgs.captures.colmap_model import ModelImage, is_model, read_model
from room2dgs.captures.depth_maps import DepthMap, depth_file
from room2dgs.captures.left_out import left_out
from room2dgs.captures.listing import Listing, inside, listed, natural
from room2dgs.captures.photos import Photo, PhotoFile, Video, VideoFrame
from room2dgs.captures.reader import Reader
from room2dgs.captures.readers.colmap import mask_file, model_shots, photo_folder
from room2dgs.captures.readers.nerfstudio import shots_of
from room2dgs.captures.readers.scannetpp_depth import HEIGHT, WIDTH, DepthStream
from room2dgs.captures.text_files import read_json_object
from room2dgs.config import SceneConfig
from room2dgs.errors import InputError

LAYOUT = "dslr/{colmap,resized_images} or iphone/{colmap,rgb.mkv}, scans/mesh_aligned_0.05.ply (ScanNet++)"
CAMERAS = ("dslr", "iphone")
DSLR_PHOTOS = ("resized_images", "original_images")
ANON_MASKS = "resized_anon_masks"
# what the toolkit makes of them: pinhole images
UNDISTORTED, UNDISTORTED_PHOTOS, UNDISTORTED_MASKS = (
    "transforms_undistorted.json", "resized_undistorted_images", "resized_undistorted_masks",
)  # fmt: skip
VIDEOS = ("rgb.mkv", "rgb.mp4")
# x, y, z of the scan are y, x, -z in its transforms.json; the way back is the same
TRANSFORMS_WORLD = np.array([[0.0, 1, 0, 0], [1, 0, 0, 0], [0, 0, -1, 0], [0, 0, 0, 1]])
WHY = "ScanNet++'s poses are in the laser scan's frame"


def is_scannetpp(files: Listing) -> bool:
    """dslr/ or iphone/ beside scans/, or one of the two itself."""
    if any(name in files for name in CAMERAS):
        return "scans" in files or any(f"{name}/colmap" in files or f"{name}/nerfstudio" in files for name in CAMERAS)
    dslr = any(name in files for name in ("train_test_lists.json", "resized_anon_masks", *DSLR_PHOTOS))
    iphone = "pose_intrinsic_imu.json" in files or "rgb.mkv" in files
    return files.root.name in CAMERAS and (dslr or iphone) and ("colmap" in files or "nerfstudio" in files)


def read_scannetpp(root: Path, config: SceneConfig) -> Capture:
    """Read one camera's photos of a scene.

    Raises:
        InputError: see `room2dgs.captures.read.read_scene`; both cameras are there and the path names neither.
    """
    if root.name in CAMERAS and not any((root / name).is_dir() for name in CAMERAS):
        folder = root
    else:
        found = [root / name for name in CAMERAS if (root / name).is_dir()]
        if len(found) > 1:
            raise InputError(
                f"{root} has photos of two cameras; give scene.path={found[0]} (DSLR) or scene.path={found[1]} (iPhone)"
            )
        if not found:
            raise InputError(f"{root} has neither dslr/ nor iphone/; a scene of ScanNet++ has {LAYOUT}")
        folder = found[0]
    capture = _dslr(folder) if folder.name == "dslr" else _iphone(folder)
    mesh = folder.parent / "scans" / "mesh_aligned_0.05.ply"
    capture.gt_mesh = mesh if mesh.is_file() else None
    capture.root = root
    lists = folder / "train_test_lists.json"
    if lists.is_file():
        names = read_json_object(lists).get("test")
        if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
            raise InputError(f"{lists} has no list of names as test; download it again")
        capture.test = frozenset(names)
    return capture


def _dslr(folder: Path) -> Capture:
    masks = folder / ANON_MASKS if (folder / ANON_MASKS).is_dir() else None
    places = [folder / name for name in DSLR_PHOTOS]
    undistorted = folder / "nerfstudio" / UNDISTORTED
    if not any(place.is_dir() for place in places) and undistorted.is_file():
        hidden = folder / UNDISTORTED_MASKS if (folder / UNDISTORTED_MASKS).is_dir() else None
        return _by_transforms(folder, undistorted, folder / UNDISTORTED_PHOTOS, hidden)
    if is_model(folder / "colmap"):
        model = read_model(folder / "colmap")
        shots = model_shots(model, photo_folder(model, places), masks)
        points = model.points if model.has_points else None
        return Capture(folder, "scannetpp", shots, W2C_OPENCV, why=WHY, points=points)
    photos = next((place for place in places if place.is_dir()), places[0])
    return _by_transforms(folder, folder / "nerfstudio" / "transforms.json", photos, masks)


def _by_transforms(folder: Path, path: Path, photos: Path, masks: Path | None) -> Capture:
    """Photos and masks in their folders, named by a transforms.json."""
    meta = read_json_object(path)
    frames = [frame for key in ("frames", "test_frames") for frame in meta.get(key) or [] if isinstance(frame, dict)]
    shots = shots_of(
        {key: value for key, value in meta.items() if key != "test_frames"},
        frames,
        path,
        partial(inside, photos, source=path),
        partial(inside, masks or photos, source=path),
    )
    test = [frame.get("file_path") for frame in meta.get("test_frames") or [] if isinstance(frame, dict)]
    held_out = frozenset(name for name in test if isinstance(name, str))
    return Capture(
        folder, "scannetpp", shots, C2W_OPENGL, why=WHY, world_from_disk=TRANSFORMS_WORLD, test=held_out or None
    )


def _iphone(folder: Path) -> Capture:
    if not is_model(folder / "colmap"):
        raise InputError(f"{folder / 'colmap'} has no COLMAP model; download the scene's iphone/colmap")
    model = read_model(folder / "colmap")
    video = next((Video(folder / name) for name in VIDEOS if (folder / name).is_file()), None)
    files = listed(folder / "rgb")
    if not files and video is None:
        raise InputError(f"{folder} has neither rgb/ nor rgb.mkv; download the scene's iPhone video")
    hidden = Video(folder / "rgb_mask.mkv") if (folder / "rgb_mask.mkv").is_file() else None
    masks = folder / "rgb_masks" if (folder / "rgb_masks").is_dir() else None
    depths = _depth_reader(folder)
    images = {image.name: image for image in model.images}
    shots, bad = [], {}
    for name in natural(images):
        image = images[name]
        try:
            index = frame_number(image, folder)
        except InputError as error:
            bad[name] = str(error)
            continue
        plain = f"frame_{index:06d}"
        path = folder / "rgb" / f"{plain}.jpg"
        photo: Photo | None = None if path.name in files or video is None else VideoFrame(video, index)
        mask: Photo | None = VideoFrame(hidden, index) if hidden else None
        if masks is not None:
            file = mask_file(masks, path.name)
            mask = PhotoFile(file) if file else mask
        lens = model.cameras[image.camera]
        shots.append(Shot(name, path, image.cam_from_world, lens, photo, depths(index, plain), mask))
    points = model.points if model.has_points else None
    message = left_out(bad, len(images), "images of the model without a frame's number")
    return Capture(folder, "scannetpp", shots, W2C_OPENCV, why=WHY, points=points, notes=[message] if message else [])


def frame_number(image: ModelImage, folder: Path) -> int:
    """A video frame's number, from 0: what follows the last _ of its name."""
    text = Path(image.name).stem.rpartition("_")[2]
    if not (text.isascii() and text.isdigit() and len(text) < 9):
        raise InputError(f"{folder / 'colmap'} has an image {image.name[:80]!r}, not frame_<number>; download it again")
    return int(text)


def _depth_reader(folder: Path):
    """(number, name) -> the frame's depth: of a PNG, or out of depth.bin."""
    files = listed(folder / "depth")
    stream = DepthStream(folder / "depth.bin") if (folder / "depth.bin").is_file() else None

    def depth(index: int, name: str) -> DepthMap | None:
        if f"{name}.png" in files:
            return depth_file(folder / "depth" / f"{name}.png")
        if stream is not None:
            return DepthMap(f"{stream.path} (frame {index})", partial(stream.frame, index), 1.0, stored=(WIDTH, HEIGHT))
        return None

    return depth


READER = Reader(is_scannetpp, read_scannetpp, LAYOUT, ("colmap", "nerfstudio"))
