"""Captures as people have them, each with one thing that a reader may get wrong, and what is right.

A case writes the made scene in a layout and changes what it is about. What is not said to differ (poses, K, depth,
masks of every photo that is read) has to be as in the unchanged layout.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from PIL import Image

from room2dgs.tools.capture_layouts.made import Made
from room2dgs.tools.capture_layouts.registry import LAYOUTS

UTM = np.array([500000.13, 5400000.37, 300.21])


@dataclass(frozen=True)
class Case:
    """What a changed capture should be read as.

    Attributes:
        layout: that is written, in `LAYOUTS`.
        change: of its folder; the scene is given too.
        scene: another scene to write; None: the made one.
        frames: that are read; None: it is refused.
        says: what has to stand in a note, a warning or, where it is refused, in the sentence.
        warns: says it as a warning.
        usable: share of the pixels that masks leave, of every photo; None: no mask.
        depths: frames that have depth; None: as many as the layout has.
        apart: the scene is another one, or the photos are other pictures: poses and K are compared in order.
    """

    layout: str
    change: Callable[[Path, Made], None]
    scene: Callable[[Made], Made] | None = None
    frames: int | None = 6
    says: str = ""
    warns: bool = False
    usable: float | None = None
    depths: int | None = None
    apart: bool = False

    def write(self, root: Path, made: Made) -> Path:
        """The capture's folder."""
        scene = self.scene(made) if self.scene else made
        LAYOUTS[self.layout].write(root, scene)
        self.change(root, scene)
        return root


def in_json(path: Path, change: Callable[[dict], Any]) -> None:
    known = json.loads(path.read_text())
    path.write_text(json.dumps(change(known) or known))


def in_text(path: Path, change: Callable[[str], str]) -> None:
    path.write_bytes(change(path.read_text()).encode())


def no_change(root: Path, made: Made) -> None:
    pass


def unmasked(made: Made) -> Made:
    return replace(made, mask=None)


def cropped(root: Path, made: Made) -> None:
    for photo in (root / "images/walk one").iterdir():
        cv2.imwrite(str(photo), cv2.imread(str(photo))[:48])
    in_text(root / "sparse/0/cameras.txt", lambda text: text.replace("PINHOLE 96 72", "PINHOLE 96 48"))


def left_quarter_hidden(made: Made, white: int = 255) -> np.ndarray:
    mask = np.full((made.height, made.width), white, np.uint8)
    mask[:, : made.width // 4] = 0
    return mask


def masks_with_a_suffix(root: Path, made: Made) -> None:
    (root / "masks/walk one").mkdir(parents=True)
    for index in range(made.count):
        cv2.imwrite(str(root / f"masks/walk one/IMG_{index + 7}_mask.png"), left_quarter_hidden(made))


def masks_of_other_photos(root: Path, made: Made) -> None:
    (root / "masks/walk one").mkdir(parents=True)
    for index in range(made.count):
        cv2.imwrite(str(root / f"masks/walk one/DSC_{index + 100}.png"), left_quarter_hidden(made))


def small_model_first(root: Path, made: Made) -> None:
    shutil.copytree(root / "sparse/0", root / "sparse/1")
    in_text(root / "sparse/0/images.txt", lambda text: "\n".join(text.split("\n")[:5]) + "\n")


def model_1_alone(root: Path, made: Made) -> None:
    (root / "sparse/0").rename(root / "sparse/1")


def turned_by_exif(root: Path, made: Made) -> None:
    def change(meta: dict) -> None:
        for frame in meta["frames"]:
            path, tag = root / frame["file_path"], Image.Exif()
            tag[0x0112] = 6
            stored = Image.open(path).convert("RGB").transpose(Image.Transpose.ROTATE_90)
            stored.save(path.with_suffix(".jpg"), quality=98, exif=tag)
            path.unlink()
            frame["file_path"] = frame["file_path"][:-4] + ".jpg"

    in_json(root / "transforms.json", change)


def masks_in_json(write: Callable[[Path, Made], None]) -> Callable[[Path, Made], None]:
    """A mask file for each frame of a transforms.json."""

    def change(root: Path, made: Made) -> None:
        (root / "masks").mkdir(exist_ok=True)

        def named(meta: dict) -> None:
            for frame in meta["frames"]:
                frame["mask_path"] = "masks/" + Path(frame["file_path"]).name
                write(root / frame["mask_path"], made)

        in_json(root / "transforms.json", named)

    return change


@masks_in_json
def green_labels(path: Path, made: Made) -> None:
    labels = Image.fromarray(left_quarter_hidden(made, white=1))
    labels.putpalette([0, 0, 0, 0, 128, 0] + [0] * 762)
    labels.save(path)


@masks_in_json
def ones_and_zeros(path: Path, made: Made) -> None:
    cv2.imwrite(str(path), left_quarter_hidden(made, white=1))


@masks_in_json
def masks_in_alpha(path: Path, made: Made) -> None:
    image = np.zeros((made.height, made.width, 4), np.uint8)
    image[..., 3] = left_quarter_hidden(made)
    cv2.imwrite(str(path), image)


@masks_in_json
def one_bit_masks(path: Path, made: Made) -> None:
    Image.fromarray(left_quarter_hidden(made)).convert("1").save(path)


@masks_in_json
def all_black(path: Path, made: Made) -> None:
    cv2.imwrite(str(path), np.zeros((made.height, made.width), np.uint8))


@masks_in_json
def nearly_all_black(path: Path, made: Made) -> None:
    mask = np.zeros((made.height, made.width), np.uint8)
    mask[:, : made.width // 16] = 255
    cv2.imwrite(str(path), mask)


@masks_in_json
def masks_on_their_side(path: Path, made: Made) -> None:
    cv2.imwrite(str(path), left_quarter_hidden(made).T.copy())


@masks_in_json
def small_masks(path: Path, made: Made) -> None:
    cv2.imwrite(str(path), left_quarter_hidden(made)[::2, ::2])


def transparent_above(root: Path, made: Made) -> None:
    for path in (root / "images").iterdir():
        image = cv2.cvtColor(cv2.imread(str(path)), cv2.COLOR_BGR2BGRA)
        image[: made.height // 2, :, 3] = 0
        cv2.imwrite(str(path), image)


def opaque_alpha(root: Path, made: Made) -> None:
    for path in (root / "images").iterdir():
        cv2.imwrite(str(path), cv2.cvtColor(cv2.imread(str(path)), cv2.COLOR_BGR2BGRA))


def initial_calibration_first(root: Path, made: Made) -> None:
    initial = (
        '<calibration type="frame" class="initial"><resolution width="96" height="72"/><f>75.6</f><k1>-0.05</k1>'
        "</calibration>"
    )
    adjusted = '<calibration type="frame" class="adjusted">'
    in_text(root / "cameras.xml", lambda text: text.replace(adjusted, initial + adjusted))


def camera_without_a_label(root: Path, made: Made) -> None:
    more = '<camera id="99"><rotation_covariance/></camera></cameras>'
    in_text(root / "cameras.xml", lambda text: text.replace("</cameras>", more))


def a_photo_gone(root: Path, made: Made) -> None:
    (root / "images/frame_00010.png").unlink()


def a_photo_cut(root: Path, made: Made) -> None:
    path = root / "images/frame_00010.png"
    path.write_bytes(path.read_bytes()[:-2000])


def every_second_gone(root: Path, made: Made) -> None:
    for index in (1, 3, 5):
        (root / f"results/frame{index:06d}.jpg").unlink()
        (root / f"results/depth{index:06d}.png").unlink()


def two_folders_of_the_same_names(root: Path, made: Made) -> None:
    text = (root / "sparse/0/images.txt").read_text()
    for index in range(made.count):
        folder = "left" if index < 3 else "right"
        (root / "images" / folder).mkdir(exist_ok=True)
        (root / f"images/walk one/IMG_{index + 7}.jpg").rename(root / f"images/{folder}/{index % 3:04d}.jpg")
        text = text.replace(f"walk one/IMG_{index + 7}.jpg\n", f"{folder}/{index % 3:04d}.jpg\n")
    (root / "sparse/0/images.txt").write_text(text)


def padded_depth(root: Path, made: Made) -> None:
    for index in range(made.count):
        (root / f"depth/{2 * index}.png").rename(root / f"depth/{2 * index:06d}.png")


def depth_of_other_names(root: Path, made: Made) -> None:
    """One is missing, so that place does not pair them either."""
    (root / "depth/0.png").unlink()
    for index in range(1, made.count):
        (root / f"depth/{2 * index}.png").rename(root / f"depth/scan_{chr(97 + index)}.png")


def depth_counted_on(root: Path, made: Made) -> None:
    """Photos 0, 2, 4, ... and depth 0, 1, 2, ...: numbers that agree by chance."""
    for index in range(made.count):
        (root / f"depth/{2 * index}.png").rename(root / f"depth/{index}.png")


def exr_depth(root: Path, made: Made) -> None:
    import OpenEXR

    (root / "depth").mkdir(exist_ok=True)
    for index in range(made.count):
        header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
        metres = (made.depths[index] / 1000).astype(np.float32)
        OpenEXR.File(header, {"R": metres}).write(str(root / f"depth/{index}.exr"))


def small_unit(made: Made) -> Made:
    poses = made.poses.copy()
    poses[:, :3, 3] *= 0.02
    return replace(made, poses=poses, xyz=made.xyz * 0.02)


def at_utm(made: Made) -> Made:
    poses = made.poses.copy()
    poses[:, :3, 3] += UTM
    return replace(made, poses=poses, xyz=made.xyz + UTM)


def depth_on_its_side(root: Path, made: Made) -> None:
    for path in sorted((root / "depth").iterdir()):
        cv2.imwrite(str(path), np.rot90(cv2.imread(str(path), cv2.IMREAD_UNCHANGED), -1).copy())


def depth_of_instant_ngp(root: Path, made: Made) -> None:
    def change(meta: dict) -> dict:
        for frame in meta["frames"]:
            frame["depth_path"] = frame.pop("depth_file_path")
        return {**meta, "enable_depth_loading": True, "integer_depth_scale": 0.001}

    in_json(root / "transforms.json", change)


def points_gone(root: Path, made: Made) -> None:
    in_json(root / "transforms.json", lambda meta: {**meta, "ply_file_path": "sparse_pc.ply"})


def two_focal_lengths(root: Path, made: Made) -> None:
    def change(meta: dict) -> None:
        for frame in meta["frames"]:
            frame.update({key: meta[key] for key in ("fl_x", "fl_y", "cx", "cy", "w", "h")})
        meta["fl_x"] *= 1.3
        meta["fl_y"] *= 1.3

    in_json(root / "transforms.json", change)


def an_unknown_key(root: Path, made: Made) -> None:
    in_json(root / "transforms.json", lambda meta: {**meta, "world_tilt_deg": 3.0})


def tabs(root: Path, made: Made) -> None:
    in_text(root / "rgb.txt", lambda text: text.replace(" rgb/", "\trgb/"))


def windows_lines(*names: str) -> Callable[[Path, Made], None]:
    def change(root: Path, made: Made) -> None:
        for name in names:
            in_text(root / name, lambda text: "\ufeff" + text.replace("\n", "\r\n"))

    return change


def a_pose_too_many(root: Path, made: Made) -> None:
    in_text(root / "traj.txt", lambda text: text + text.splitlines()[-1] + "\n")


def lines_gone_from_the_middle(root: Path, made: Made) -> None:
    in_text(root / "traj.txt", lambda text: "\n".join(text.splitlines()[:2] + text.splitlines()[3:]) + "\n")


CASES: dict[str, Case] = {
    "colmap: photos are cropped": Case("colmap", cropped, says="principal point", warns=True, apart=True),
    "colmap: masks end in _mask": Case("colmap", masks_with_a_suffix, usable=0.75),
    "colmap: masks are of other photos": Case("colmap", masks_of_other_photos, says="masks", warns=True),
    "colmap: the first model is small": Case("colmap", small_model_first, says="sparse/1"),
    "colmap: one model, called 1": Case("colmap", model_1_alone),
    "colmap: two folders of the same names": Case("colmap", two_folders_of_the_same_names),
    "colmap: a unit of two centimetres": Case("colmap", no_change, scene=small_unit, says="unknown", apart=True),
    "colmap: line ends of Windows": Case("colmap", windows_lines("sparse/0/images.txt", "sparse/0/cameras.txt")),
    "nerfstudio: photos are turned by EXIF": Case("nerfstudio", turned_by_exif, scene=unmasked, says="turned"),
    "nerfstudio: masks are green labels": Case("nerfstudio", green_labels, usable=0.75),
    "nerfstudio: masks of 0 and 1": Case("nerfstudio", ones_and_zeros, usable=0.75),
    "nerfstudio: masks in alpha": Case("nerfstudio", masks_in_alpha, usable=0.75),
    "nerfstudio: masks of one bit": Case("nerfstudio", one_bit_masks, usable=0.75),
    "nerfstudio: small masks": Case("nerfstudio", small_masks, usable=0.75),
    "nerfstudio: masks are black all over": Case("nerfstudio", all_black, frames=None, says="white"),
    "nerfstudio: masks hide 94 %": Case("nerfstudio", nearly_all_black, says="white", warns=True, usable=0.0625),
    "nerfstudio: masks on their side": Case("nerfstudio", masks_on_their_side, frames=None, says="its side"),
    "nerfstudio: photos are transparent above": Case("nerfstudio", transparent_above, scene=unmasked, usable=0.5),
    "nerfstudio: photos with an opaque alpha": Case("nerfstudio", opaque_alpha, scene=unmasked),
    "nerfstudio: a photo is gone": Case("nerfstudio", a_photo_gone, frames=5, says="frame_00010", warns=True),
    "nerfstudio: a photo is cut": Case("nerfstudio", a_photo_cut, frames=5, says="frame_00010", warns=True),
    "nerfstudio: depth on its side": Case("nerfstudio", depth_on_its_side, frames=None, says="its side"),
    "nerfstudio: depth as instant-ngp names it": Case("nerfstudio", depth_of_instant_ngp),
    "nerfstudio: points that are gone": Case("nerfstudio", points_gone, says="sparse_pc.ply"),
    "nerfstudio: two focal lengths": Case("nerfstudio", two_focal_lengths, says="105.3", warns=True),
    "nerfstudio: a key nobody knows": Case("nerfstudio", an_unknown_key, says="world_tilt_deg"),
    "metashape: the initial calibration first": Case("metashape", initial_calibration_first),
    "metashape: a camera without a label": Case("metashape", camera_without_a_label),
    "replica: every second photo is gone": Case("replica", every_second_gone, frames=3),
    "replica: a pose too many": Case("replica", a_pose_too_many, says="6 of the 7"),
    "replica: a pose is gone from the middle": Case("replica", lines_gone_from_the_middle, frames=None, says="5"),
    "record3d: depth in OpenEXR": Case("record3d", exr_depth, depths=6, apart=True),
    "scannet: depth of padded names": Case("scannet", padded_depth, depths=6),
    "scannet: depth of other names": Case("scannet", depth_of_other_names, depths=0, says="depth", warns=True),
    "scannet: depth is counted on": Case(
        "scannet", depth_counted_on, depths=3, says="3 photos have none", warns=True, apart=True
    ),
    "scannet: coordinates of UTM": Case("scannet", no_change, scene=at_utm, says="origin", apart=True),
    "tum: tabs": Case("tum", tabs),
    "tum: line ends of Windows": Case("tum", windows_lines("rgb.txt", "depth.txt", "groundtruth.txt")),
}
