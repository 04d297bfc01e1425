"""The keys of a transforms.json: those that are read, those that mean nothing for a mesh, and those that are named."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from room2dgs.captures.known_keys import unknown_keys
from room2dgs.captures.readers.transforms_lens import LENS_KEYS, OTHER_CAMERAS
from room2dgs.errors import InputError

READ = (
    *LENS_KEYS,
    "frames",
    "applied_transform",
    "applied_scale",
    "depth_unit_scale_factor",
    "integer_depth_scale",
    "enable_depth_loading",
    "ply_file_path",
    "train_filenames",
    "val_filenames",
    "test_filenames",
)
READ_OF_FRAME = (*LENS_KEYS, "file_path", "transform_matrix", "depth_file_path", "depth_path", "mask_path")
# Other programs' settings of their training, and measurements that no pose depends on. instant-ngp's scale, offset and
# box place the poses in its unit cube when it loads them; the poses in the file are before that.
OTHERWISE = (
    "aabb", "aabb_scale", "scale", "offset", "up", "render_aabb", "from_na", "orientation_override", "sharpen",
    "sharpness_discard_threshold", "white_transparent", "black_transparent", "importance_sampling", "envmap",
    "n_extra_learnable_dims", "fix_premult", "enable_ray_loading", "camera", "scene_box", "auto_scale_poses_override",
    "fps", "date", "version", "source", "scene", "name", "labels", "categories", "has_mask", "crop", "is_hdr",
)  # fmt: skip
OTHERWISE_OF_FRAME = (
    "sharpness", "time", "timestamp", "rotation", "colmap_im_id", "colmap_image_id", "frame_id", "camera_id",
    "image_id", "is_bad", "driver_parameters", "exposure", "iso", "shutter", "index", "id", "name", "split",
    "motion_quality", "blur_score", "fps", "mono_depth_path", "normal_path", "segmentation_path", "camera_label",
    "cam_idx",
)  # fmt: skip
# What instant-ngp reads and could change the geometry: told if it is there.
NOT_READ = {
    "rolling_shutter": "each photo is taken as exposed at once",
    "transform_matrix_start": "a frame's transform_matrix is its pose",
    "transform_matrix_end": "a frame's transform_matrix is its pose",
    "n_frames": "all frames are read",
}


def key_notes(meta: Mapping[str, Any], frames: Sequence[Mapping[str, Any]], path: Path) -> tuple[list[str], list[str]]:
    """Notes and warnings of keys that are not read.

    Raises:
        InputError: a camera, or axes, that are not read.
    """
    found = {key: None for frame in frames for key in frame}
    other = [key for key in OTHER_CAMERAS if key in meta or key in found]
    if other:
        raise InputError(f"{path} has {other[0]}, a camera that is not read; undistort the photos to PINHOLE")
    if "normal_mts_args" in meta:
        raise InputError(
            f"{path} has normal_mts_args: its poses have Mitsuba's camera axes (x to the left, z into the photo), "
            "which are not read; turn them to OpenGL's and delete the key"
        )
    used = [key for key in NOT_READ if key in found or _says_something(meta.get(key))]
    warnings = [f"{path} has {key}, which is not used: {NOT_READ[key]}" for key in used]
    warned_of = (*NOT_READ, *OTHER_CAMERAS)
    sentences = [
        unknown_keys(meta, (*READ, *OTHERWISE, *warned_of), path),
        unknown_keys(found, (*READ_OF_FRAME, *OTHERWISE_OF_FRAME, *warned_of), f"{path} (frames)"),
    ]
    return [sentence for sentence in sentences if sentence], warnings


def _says_something(value: Any) -> bool:
    """Zeros and null do not."""
    return any(value) if isinstance(value, list) else bool(value)
