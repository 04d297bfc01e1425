"""One made scene, written in each layout from the layout's description: numbers as the format has them, by hand."""

from __future__ import annotations

import json
import shutil
import struct
import zipfile
import zlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import liblzfse
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

WIDTH, HEIGHT = 96, 72
COUNT = 6
FX, FY, CX, CY = 81.0, 84.0, 46.5, 37.25  # pixel centres at +0.5
GL = np.diag([1.0, -1.0, -1.0, 1.0])


@dataclass(frozen=True)
class Made:
    """A scene as it is.

    Attributes:
        poses: (COUNT, 4, 4) camera-to-world, metres, OpenCV axes.
        photos: (COUNT, HEIGHT, WIDTH, 3) uint8 BGR.
        depths: (COUNT, HEIGHT, WIDTH) whole millimetres.
        xyz: (M, 3) points; rgb: (M, 3) uint8.
        seen: for each photo, (N,) indices of points and (N, 2) pixels, centres at +0.5.
    """

    poses: np.ndarray
    photos: np.ndarray
    depths: np.ndarray
    xyz: np.ndarray
    rgb: np.ndarray
    seen: list[tuple[np.ndarray, np.ndarray]]

    @property
    def K(self) -> np.ndarray:
        return np.array([[FX, 0, CX], [0, FY, CY], [0, 0, 1.0]])


@pytest.fixture(scope="session")
def made() -> Made:
    random = np.random.default_rng(7)
    poses = np.tile(np.eye(4), (COUNT, 1, 1))
    poses[:, :3, :3] = Rotation.from_rotvec(random.uniform(-0.25, 0.25, (COUNT, 3))).as_matrix()
    poses[:, :3, 3] = random.uniform(-0.4, 0.4, (COUNT, 3))
    photos = random.integers(0, 255, (COUNT, HEIGHT // 8, WIDTH // 8, 3), np.uint8)
    photos = np.stack([cv2.resize(photo, (WIDTH, HEIGHT), interpolation=cv2.INTER_CUBIC) for photo in photos])
    depths = random.integers(500, 4000, (COUNT, HEIGHT, WIDTH)).astype(np.uint16)
    depths[:, :4] = 0
    xyz = random.uniform([-2.0, -1.5, 2.0], [2.0, 1.5, 4.0], (600, 3))
    rgb = random.integers(0, 255, (600, 3), np.uint8)
    seen = []
    for pose in poses:
        at = (xyz - pose[:3, 3]) @ pose[:3, :3]
        pixel = at[:, :2] / at[:, 2:] * (FX, FY) + (CX, CY)
        index = np.flatnonzero(((pixel > 0) & (pixel < (WIDTH, HEIGHT))).all(axis=1))
        seen.append((index, pixel[index]))
    return Made(poses, photos, depths, xyz, rgb, seen)


def w2c(pose: np.ndarray) -> np.ndarray:
    return np.linalg.inv(pose)


def wxyz(rotation: np.ndarray) -> np.ndarray:
    x, y, z, w = Rotation.from_matrix(rotation).as_quat()
    return np.array([w, x, y, z])


def text(values) -> str:
    return " ".join(f"{value:.17g}" for value in np.ravel(values))


def rows(matrix) -> str:
    return "\n".join(text(row) for row in matrix) + "\n"


def matrix(pose: np.ndarray) -> list[list[float]]:
    return [[float(value) for value in row] for row in pose]


def jpg(path: Path, photo: np.ndarray) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    assert cv2.imwrite(str(path), photo)


def scannet(root: Path, made: Made, frames: str = "") -> None:
    """color/<i>.jpg, depth/<i>.png in mm, pose/<i>.txt; cx, cy count integers."""
    root = root / frames if frames else root
    for name in ("pose", "intrinsic"):
        (root / name).mkdir(parents=True)
    K = np.eye(4)
    K[:3, :3] = made.K - np.array([[0, 0, 0.5], [0, 0, 0.5], [0, 0, 0]])
    (root / "intrinsic/intrinsic_color.txt").write_text(rows(K))
    (root / "intrinsic/intrinsic_depth.txt").write_text(rows(K))
    for i, pose in enumerate(made.poses):
        jpg(root / f"color/{2 * i}.jpg", made.photos[i])
        jpg(root / f"depth/{2 * i}.png", made.depths[i])
        (root / f"pose/{2 * i}.txt").write_text(rows(pose))


def scannet_frames(root: Path, made: Made) -> None:
    scannet(root, made, "frames")


def scannet_flat(root: Path, made: Made) -> None:
    """What the C++ reader of .sens writes."""
    K = text([FX, 0, CX - 0.5, 0, 0, FY, CY - 0.5, 0, 0, 0, 1, 0, 0, 0, 0, 1])
    root.mkdir(parents=True)
    (root / "_info.txt").write_text(
        f"m_versionNumber = 4\nm_sensorName = StructureSensor\nm_colorWidth = {WIDTH}\nm_colorHeight = {HEIGHT}\n"
        f"m_depthWidth = {WIDTH}\nm_depthHeight = {HEIGHT}\nm_depthShift = 1000\n"
        f"m_calibrationColorIntrinsic = {K}\nm_frames.size = {COUNT}\n"
    )
    for i, pose in enumerate(made.poses):
        jpg(root / f"frame-{i:06d}.color.jpg", made.photos[i])
        jpg(root / f"frame-{i:06d}.depth.png", made.depths[i])
        (root / f"frame-{i:06d}.pose.txt").write_text(rows(pose))


def sens(root: Path, made: Made) -> None:
    """One file, little endian, version 4."""
    root.mkdir(parents=True)
    K = np.eye(4, dtype="<f4")
    K[:3, :3] = made.K - np.array([[0, 0, 0.5], [0, 0, 0.5], [0, 0, 0]])
    eye = np.eye(4, dtype="<f4")
    with (root / "scene0000_00.sens").open("wb") as file:
        file.write(struct.pack("<IQ", 4, 15) + b"StructureSensor")
        for values in (K, eye, K, eye):
            file.write(values.tobytes())
        file.write(struct.pack("<iiIIIIfQ", 2, 1, WIDTH, HEIGHT, WIDTH, HEIGHT, 1000.0, COUNT))
        for i, pose in enumerate(made.poses):
            color = cv2.imencode(".jpg", made.photos[i])[1].tobytes()
            depth = zlib.compress(made.depths[i].astype("<u2").tobytes())
            file.write(pose.astype("<f4").tobytes() + struct.pack("<4Q", 1000 * i, 1000 * i, len(color), len(depth)))
            file.write(color + depth)
        file.write(struct.pack("<Q", 0))


def colmap_names(count: int) -> list[str]:
    """With a folder, a space, and numbers that sort otherwise as text."""
    return [f"walk one/IMG_{i + 7}.jpg" for i in range(count)]


def colmap_text(folder: Path, made: Made, names: list[str], camera: str, poses=None) -> None:
    """cameras.txt, images.txt with two lines an image, points3D.txt."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "cameras.txt").write_text(f"# Camera list\n3 {camera}\n")
    lines, tracks = ["# Image list with two lines of data per image:"], {}
    for i, pose in enumerate(made.poses if poses is None else poses):
        cam_from_world = w2c(pose)
        lines.append(f"{i + 10} {text(wxyz(cam_from_world[:3, :3]))} {text(cam_from_world[:3, 3])} 3 {names[i]}")
        index, pixel = made.seen[i]
        features = ["1.5 2.5 -1"]
        for feature, (point, (x, y)) in enumerate(zip(index, pixel, strict=True), start=1):
            features.append(f"{x:.9f} {y:.9f} {point + 100}")
            tracks.setdefault(point, []).append(f"{i + 10} {feature}")
        lines.append(" ".join(features))
    (folder / "images.txt").write_text("\n".join(lines) + "\n")
    points = [
        f"{point + 100} {text(made.xyz[point])} {' '.join(map(str, made.rgb[point]))} 0.3 {' '.join(track)}"
        for point, track in tracks.items()
    ]
    (folder / "points3D.txt").write_text("# 3D point list\n" + "\n".join(points) + "\n")


def pinhole_camera() -> str:
    return f"PINHOLE {WIDTH} {HEIGHT} {text([FX, FY, CX, CY])}"


def colmap(root: Path, made: Made) -> None:
    names = colmap_names(COUNT)
    for name, photo in zip(names, made.photos, strict=True):
        jpg(root / "images" / name, photo)
    colmap_text(root / "sparse/0", made, names, pinhole_camera())


def colmap_binary(root: Path, made: Made) -> None:
    """The same as u64 counts and little-endian records."""
    names = colmap_names(COUNT)
    folder = root / "sparse"
    folder.mkdir(parents=True)
    for name, photo in zip(names, made.photos, strict=True):
        jpg(root / "images" / name, photo)
    (folder / "cameras.bin").write_bytes(struct.pack("<QIiQQ4d", 1, 3, 1, WIDTH, HEIGHT, FX, FY, CX, CY))
    images, tracks = [struct.pack("<Q", COUNT)], {}
    for i, pose in enumerate(made.poses):
        cam_from_world = w2c(pose)
        images.append(struct.pack("<I7dI", i + 10, *wxyz(cam_from_world[:3, :3]), *cam_from_world[:3, 3], 3))
        images.append(names[i].encode() + b"\0")
        index, pixel = made.seen[i]
        images.append(struct.pack("<Q", len(index) + 1) + struct.pack("<ddQ", 1.5, 2.5, 2**64 - 1))
        for feature, (point, (x, y)) in enumerate(zip(index, pixel, strict=True), start=1):
            images.append(struct.pack("<ddQ", x, y, point + 100))
            tracks.setdefault(int(point), []).append((i + 10, feature))
    (folder / "images.bin").write_bytes(b"".join(images))
    points = [struct.pack("<Q", len(tracks))]
    for point, track in tracks.items():
        points.append(struct.pack("<Q3d3BdQ", point + 100, *made.xyz[point], *made.rgb[point], 0.3, len(track)))
        points += [struct.pack("<II", *element) for element in track]
    (folder / "points3D.bin").write_bytes(b"".join(points))


def nerfstudio(root: Path, made: Made) -> None:
    """OpenGL axes; the saved world is (x, z, -y) of the capture's, at half its size."""
    applied = np.array([[1.0, 0, 0, 0.1], [0, 0, 1, 0.2], [0, -1, 0, -0.3]])
    frames = []
    for i, pose in enumerate(made.poses):
        jpg(root / f"images/frame_{i + 8:05d}.png", made.photos[i])
        jpg(root / f"depth/frame_{i + 8:05d}.png", made.depths[i])
        saved = np.eye(4)
        saved[:3, :3] = applied[:, :3] @ pose[:3, :3]
        saved[:3, 3] = 0.5 * (applied[:, :3] @ pose[:3, 3] + applied[:, 3])
        frames.append(
            {
                "file_path": f"images/frame_{i + 8:05d}.png",
                "depth_file_path": f"depth/frame_{i + 8:05d}.png",
                "transform_matrix": matrix(saved @ GL),
            }
        )
    meta = {"w": WIDTH, "h": HEIGHT, "fl_x": FX, "fl_y": FY, "cx": CX, "cy": CY, "camera_model": "OPENCV"}
    meta |= {"k1": 0.0, "k2": 0.0, "p1": 0.0, "p2": 0.0, "applied_transform": applied.tolist(), "applied_scale": 0.5}
    (root / "transforms.json").write_text(json.dumps({**meta, "frames": frames[::-1]}))


def instant_ngp(root: Path, made: Made) -> None:
    """Fields of view, no suffix, 3x4 matrices, intrinsics a frame."""
    root.mkdir(parents=True)
    frames = []
    for i, pose in enumerate(made.poses):
        jpg(root / f"images/{i + 8}.png", made.photos[i])
        frames.append({"file_path": f"./images/{i + 8}", "transform_matrix": matrix((pose @ GL)[:3])})
        frames[-1] |= {
            "camera_angle_x": 2 * np.arctan(WIDTH / 2 / FX),
            "y_fov": np.degrees(2 * np.arctan(HEIGHT / 2 / FY)),
        }
        frames[-1] |= {"cx": CX, "cy": CY}
    (root / "transforms.json").write_text(json.dumps({"frames": frames, "aabb_scale": 4}))


# World-to-scan of ScanNet++'s transforms.json: x, y, z -> y, x, -z.
SWAPPED = np.array([[0.0, 1, 0, 0], [1, 0, 0, 0], [0, 0, -1, 0], [0, 0, 0, 1]])


def scannetpp_dslr(root: Path, made: Made) -> None:
    names = [f"DSC{i + 98:05d}.JPG" for i in range(COUNT)]
    folder = root / "dslr"
    for i, name in enumerate(names):
        jpg(folder / "resized_images" / name, made.photos[i])
        mask = np.full((HEIGHT, WIDTH), 255, np.uint8)
        mask[:10, :10] = 0
        jpg(folder / "resized_anon_masks" / f"{Path(name).stem}.png", mask)
    colmap_text(folder / "colmap", made, names, pinhole_camera())
    (folder / "train_test_lists.json").write_text(json.dumps({"train": names[1:], "test": names[:1]}))
    (root / "scans").mkdir()
    (root / "scans/mesh_aligned_0.05.ply").write_text("ply\n")


def scannetpp_json(root: Path, made: Made) -> None:
    """Without the COLMAP model: transforms.json alone."""
    folder = root / "dslr"
    frames = []
    for i, pose in enumerate(made.poses):
        jpg(folder / f"resized_images/DSC{i + 98:05d}.JPG", made.photos[i])
        frames.append({"file_path": f"DSC{i + 98:05d}.JPG", "transform_matrix": matrix(SWAPPED @ pose @ GL)})
    meta = {"fl_x": FX, "fl_y": FY, "cx": CX, "cy": CY, "w": WIDTH, "h": HEIGHT, "camera_model": "PINHOLE"}
    (folder / "nerfstudio").mkdir()
    meta |= {"frames": frames[1:], "test_frames": frames[:1]}
    (folder / "nerfstudio/transforms.json").write_text(json.dumps(meta))
    (root / "scans").mkdir()


def scannetpp_iphone(root: Path, made: Made, video: bool = False) -> None:
    folder = root / "iphone"
    names = [f"video/frame_{10 * i:06d}.jpg" for i in range(COUNT)]
    colmap_text(folder / "colmap", made, names, pinhole_camera())
    (folder / "pose_intrinsic_imu.json").write_text("{}")
    for i in range(COUNT):
        jpg(folder / f"rgb/frame_{10 * i:06d}.jpg", made.photos[i])
        jpg(folder / f"depth/frame_{10 * i:06d}.png", made.depths[i])


def int_K() -> list[float]:
    return [FX, FY, CX - 0.5, CY - 0.5]


def int_K44(made: Made) -> np.ndarray:
    K = np.eye(4)
    K[:3, :3] = made.K - np.array([[0, 0, 0.5], [0, 0, 0.5], [0, 0, 0]])
    return K


def replica(root: Path, made: Made) -> None:
    """traj.txt of 16 numbers a line; cam_params.json beside the scenes; its scale is units of depth a metre."""
    root.mkdir(parents=True)
    (root / "traj.txt").write_text("\n".join(text(pose) for pose in made.poses) + "\n")
    camera = dict(zip(("fx", "fy", "cx", "cy"), int_K(), strict=True)) | {"w": WIDTH, "h": HEIGHT, "scale": 1000.0}
    (root.parent / "cam_params.json").write_text(json.dumps({"camera": camera}))
    for i in range(COUNT):
        jpg(root / f"results/frame{i:06d}.jpg", made.photos[i])
        jpg(root / f"results/depth{i:06d}.png", made.depths[i])


def tum(root: Path, made: Made) -> None:
    """Lists with times; depth of 5000 a metre."""
    root.mkdir(parents=True)
    rgb, depth, truth = ["# color images"], ["# depth maps"], ["# timestamp tx ty tz qx qy qz qw"]
    for i, pose in enumerate(made.poses):
        stamp = 1305031102.175304 + 0.5 * i
        jpg(root / f"rgb/{stamp:.6f}.png", made.photos[i])
        jpg(root / f"depth/{stamp + 0.01:.6f}.png", 5 * made.depths[i])
        rgb.append(f"{stamp:.6f} rgb/{stamp:.6f}.png")
        depth.append(f"{stamp + 0.01:.6f} depth/{stamp + 0.01:.6f}.png")
        w, x, y, z = wxyz(pose[:3, :3])
        truth.append(f"{stamp:.6f} {text(pose[:3, 3])} {text([x, y, z, w])}")
    (root / "rgb.txt").write_text("\n".join(rgb))
    (root / "depth.txt").write_text("\n".join(depth))
    (root / "groundtruth.txt").write_text("\n".join(truth))


def sevenscenes(root: Path, made: Made) -> None:
    for i, pose in enumerate(made.poses):
        folder = root / f"seq-{1 + i // 3:02d}"
        jpg(folder / f"frame-{i:06d}.color.png", made.photos[i])
        lines = ("\t ".join(f"{value:.17g}" for value in row) for row in pose)
        (folder / f"frame-{i:06d}.pose.txt").write_text("\t\n".join(lines))


def neuralrgbd(root: Path, made: Made) -> None:
    """Four lines a pose, OpenGL axes."""
    (root / "images").mkdir(parents=True)
    (root / "poses.txt").write_text("".join(rows(pose @ GL) for pose in made.poses))
    for i in range(COUNT):
        jpg(root / f"images/img{i + 8}.png", made.photos[i])
        jpg(root / f"depth/depth{i + 8}.png", made.depths[i])


def monosdf(root: Path, made: Made) -> None:
    """world_mat = K times world-to-camera; scale_mat leads to another frame."""
    root.mkdir(parents=True)
    arrays = {}
    for i, pose in enumerate(made.poses):
        jpg(root / f"{i:06d}_rgb.png", made.photos[i])
        arrays |= {f"world_mat_{i}": int_K44(made) @ w2c(pose), f"scale_mat_{i}": np.diag([2.5, 2.5, 2.5, 1.0])}
    np.savez(root / "cameras.npz", **arrays)


def sdfstudio(root: Path, made: Made) -> None:
    """Normalised: the metric world is worldtogt times it."""
    root.mkdir(parents=True)
    to_truth = np.diag([2.5, 2.5, 2.5, 1.0])
    to_truth[:3, 3] = [0.3, -0.2, 0.1]
    frames = []
    for i, pose in enumerate(made.poses):
        jpg(root / f"{i:06d}_rgb.png", made.photos[i])
        normalised = pose.copy()
        normalised[:3, 3] = (pose[:3, 3] - to_truth[:3, 3]) / 2.5
        K = matrix(int_K44(made))
        frames.append({"rgb_path": f"{i:06d}_rgb.png", "camtoworld": matrix(normalised), "intrinsics": K})
    meta = {"camera_model": "OPENCV", "height": HEIGHT, "width": WIDTH, "worldtogt": matrix(to_truth)}
    (root / "meta_data.json").write_text(json.dumps({**meta, "frames": frames}))


def polycam(root: Path, made: Made) -> None:
    """t_<row><column>, OpenGL axes; depth in mm."""
    for i, pose in enumerate(made.poses):
        gl, name = pose @ GL, f"{40219379 + 1000 * i}"
        camera = {f"t_{row}{column}": gl[row, column] for row in range(3) for column in range(4)}
        camera |= {"fx": FX, "fy": FY, "cx": CX, "cy": CY, "width": WIDTH, "height": HEIGHT, "blur_score": 90.0}
        jpg(root / f"keyframes/corrected_images/{name}.jpg", made.photos[i])
        jpg(root / f"keyframes/depth/{name}.png", made.depths[i])
        path = root / f"keyframes/corrected_cameras/{name}.json"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(camera))


def polycam_zip(root: Path, made: Made) -> None:
    polycam(root / "made", made)
    with zipfile.ZipFile(root / "capture.zip", "w") as archive:
        for path in sorted((root / "made").rglob("*.*")):
            archive.write(path, f"My room/{path.relative_to(root / 'made')}")
    shutil.rmtree(root / "made")


def record3d_meta(made: Made) -> dict:
    poses = []
    for pose in made.poses:
        w, x, y, z = wxyz((pose @ GL)[:3, :3])
        poses.append([float(value) for value in (x, y, z, w, *pose[:3, 3])])
    K = [float(value) for value in made.K.T.ravel()]
    return {"w": WIDTH, "h": HEIGHT, "dw": WIDTH, "dh": HEIGHT, "fps": 60, "K": K, "poses": poses}


def record3d(root: Path, made: Made) -> None:
    """The export with photos and metadata.json."""
    for i in range(COUNT):
        jpg(root / f"rgb/{i}.jpg", made.photos[i])
    (root / "metadata.json").write_text(json.dumps(record3d_meta(made)))


def record3d_archive(root: Path, made: Made) -> None:
    """An .r3d: a zip; depth in metres, NaN = none, packed by LZFSE."""
    root.mkdir(parents=True)
    with zipfile.ZipFile(root / "room.r3d", "w") as archive:
        archive.writestr("metadata", json.dumps(record3d_meta(made)))
        for i in range(COUNT):
            archive.writestr(f"rgbd/{i}.jpg", cv2.imencode(".jpg", made.photos[i])[1].tobytes())
            metres = np.where(made.depths[i] > 0, made.depths[i] / 1000, np.nan).astype("<f4")
            archive.writestr(f"rgbd/{i}.depth", liblzfse.compress(metres.tobytes()))


def stray(root: Path, made: Made) -> None:
    """A video; columns by their names, OpenCV axes."""
    root.mkdir(parents=True)
    writer = cv2.VideoWriter(str(root / "rgb.mp4"), cv2.VideoWriter_fourcc(*"mp4v"), 30, (WIDTH, HEIGHT))
    lines = ["timestamp, frame, x, y, z, qx, qy, qz, qw"]
    for i, pose in enumerate(made.poses):
        writer.write(made.photos[i])
        jpg(root / f"depth/{i:06d}.png", made.depths[i])
        w, x, y, z = wxyz(pose[:3, :3])
        values = ", ".join(f"{value:.17g}" for value in (*pose[:3, 3], x, y, z, w))
        lines.append(f"{0.1 * i}, {i:06d}, {values}")
    writer.release()
    (root / "odometry.csv").write_text("\n".join(lines) + "\n")
    (root / "camera_matrix.csv").write_text("\n".join(", ".join(map(repr, row)) for row in made.K.tolist()))


def arkitscenes(root: Path, made: Made) -> None:
    """World-to-camera as axis times angle; names end in seconds."""
    folder = root / "41069021_frames"
    (folder / "lowres_wide_intrinsics").mkdir(parents=True)
    lines = []
    for i, pose in enumerate(made.poses):
        stamp = 6790.123 + 0.1 * i
        name = f"41069021_{stamp:.3f}"
        jpg(folder / f"lowres_wide/{name}.png", made.photos[i])
        jpg(folder / f"lowres_depth/{name}.png", made.depths[i])
        pincam = folder / f"lowres_wide_intrinsics/41069021_{stamp + 0.001:.3f}.pincam"
        pincam.write_text(f"{WIDTH} {HEIGHT} {text([FX, FY, CX, CY])}")
        cam_from_world = w2c(pose)
        turn = Rotation.from_matrix(cam_from_world[:3, :3]).as_rotvec()
        lines.append(f"{stamp + 0.002:.6f} {text(turn)} {text(cam_from_world[:3, 3])}")
    (folder / "lowres_wide.traj").write_text("\n".join(lines) + "\n")
    (root / "41069021_3dod_mesh.ply").write_text("ply\n")


def open3d(root: Path, made: Made) -> None:
    """Five lines a frame."""
    (root / "scene").mkdir(parents=True)
    blocks = []
    for i, pose in enumerate(made.poses):
        jpg(root / f"color/{i:05d}.jpg", made.photos[i])
        jpg(root / f"depth/{i:05d}.png", made.depths[i])
        blocks.append(f"{i} {i} {i + 1}\n{rows(pose)}")
    (root / "scene/trajectory.log").write_text("".join(blocks))


def metashape(root: Path, made: Made) -> None:
    """cx, cy from the photo's middle; a component that is turned and moved."""
    root.mkdir(parents=True)
    inner = np.eye(4)
    inner[:3, :3], inner[:3, 3] = Rotation.from_rotvec([0.2, -0.1, 0.3]).as_matrix(), [0.5, 0.1, -0.2]
    cameras = []
    for i, pose in enumerate(made.poses):
        jpg(root / f"images/IMG_{i + 8}.JPG", made.photos[i])
        own = text(np.linalg.inv(inner) @ pose)
        cameras.append(
            f'<camera id="{i}" sensor_id="0" component_id="0" label="IMG_{i + 8}"><transform>{own}</transform></camera>'
        )
    (root / "cameras.xml").write_text(
        '<?xml version="1.0" encoding="UTF-8"?>\n<document version="2.0.0"><chunk label="Chunk 1"><sensors>'
        f'<sensor id="0" label="x" type="frame"><resolution width="{WIDTH}" height="{HEIGHT}"/>'
        f'<calibration type="frame" class="adjusted"><resolution width="{WIDTH}" height="{HEIGHT}"/>'
        f"<f>{FY}</f><b1>{FX - FY}</b1><cx>{CX - WIDTH / 2}</cx><cy>{CY - HEIGHT / 2}</cy></calibration></sensor>"
        f'</sensors><components><component id="0"><transform><rotation>{text(inner[:3, :3])}</rotation>'
        f"<translation>{text(2 * inner[:3, 3])}</translation><scale>2</scale></transform></component></components>"
        f"<cameras>{''.join(cameras)}</cameras></chunk></document>"
    )


def ros_header(store, frame: str, nanoseconds: int):
    stamp = store.types["builtin_interfaces/msg/Time"](sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)
    counted = {"seq": 0} if "seq" in store.types["std_msgs/msg/Header"].__dataclass_fields__ else {}
    return store.types["std_msgs/msg/Header"](**counted, stamp=stamp, frame_id=frame)


class RosMessages:
    """Messages of ROS 1 or 2 with the fields that their definitions name."""

    def __init__(self, ros1: bool) -> None:
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore

        self.ros1 = ros1
        self.store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
        self.tf = "tf2_msgs/msg/TFMessage"
        if self.tf not in self.store.types:
            self.store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", self.tf))

    def make(self, kind: str, **fields):
        return self.store.types[kind](**fields)

    def header(self, frame: str, stamp: int):
        return ros_header(self.store, frame, stamp)

    def image(self, frame: str, stamp: int, pixels: np.ndarray, encoding: str, pad: int = 0):
        """Rows are `pad` bytes longer than their pixels."""
        rows = np.ascontiguousarray(pixels).view(np.uint8).reshape(len(pixels), -1)
        data = np.pad(rows, ((0, 0), (0, pad)), constant_values=77)
        return self.make(
            "sensor_msgs/msg/Image",
            header=self.header(frame, stamp),
            height=len(pixels),
            width=pixels.shape[1],
            encoding=encoding,
            is_bigendian=0,
            step=data.shape[1],
            data=data.ravel(),
        )

    def packed(self, frame: str, stamp: int, data: bytes, form: str):
        header = self.header(frame, stamp)
        data = np.frombuffer(data, np.uint8)
        return self.make("sensor_msgs/msg/CompressedImage", header=header, format=form, data=data)

    def info(self, frame: str, stamp: int, K: np.ndarray, D=(), model: str = "plumb_bob"):
        roi = self.make("sensor_msgs/msg/RegionOfInterest", x_offset=0, y_offset=0, height=0, width=0, do_rectify=False)
        names = "DKRP" if self.ros1 else "dkrp"
        P = np.c_[K, np.zeros(3)]
        values = np.array(D, np.float64), K.ravel(), np.eye(3).ravel(), P.ravel()
        matrices = dict(zip(names, values, strict=True))
        return self.make(
            "sensor_msgs/msg/CameraInfo",
            header=self.header(frame, stamp),
            height=HEIGHT,
            width=WIDTH,
            distortion_model=model,
            binning_x=0,
            binning_y=0,
            roi=roi,
            **matrices,
        )

    def placed(self, pose: np.ndarray, where: str, how: str, point: str, of: str):
        x, y, z, w = Rotation.from_matrix(pose[:3, :3]).as_quat()
        at = self.make(f"geometry_msgs/msg/{point}", **dict(zip("xyz", pose[:3, 3], strict=True)))
        turned = self.make("geometry_msgs/msg/Quaternion", x=x, y=y, z=z, w=w)
        return self.make(f"geometry_msgs/msg/{of}", **{where: at, how: turned})

    def transform(self, parent: str, child: str, stamp: int, pose: np.ndarray):
        return self.make(
            "geometry_msgs/msg/TransformStamped",
            header=self.header(parent, stamp),
            child_frame_id=child,
            transform=self.placed(pose, "translation", "rotation", "Vector3", "Transform"),
        )

    def transforms(self, *each):
        return self.make(self.tf, transforms=list(each))

    def pose(self, parent: str, stamp: int, pose: np.ndarray):
        inner = self.placed(pose, "position", "orientation", "Point", "Pose")
        return self.make("geometry_msgs/msg/PoseStamped", header=self.header(parent, stamp), pose=inner)

    def odometry(self, parent: str, child: str, stamp: int, pose: np.ndarray):
        inner = self.placed(pose, "position", "orientation", "Point", "Pose")
        nothing = self.make("geometry_msgs/msg/Vector3", x=0.0, y=0.0, z=0.0)
        still = self.make("geometry_msgs/msg/Twist", linear=nothing, angular=nothing)
        unsure = np.zeros(36)
        return self.make(
            "nav_msgs/msg/Odometry",
            header=self.header(parent, stamp),
            child_frame_id=child,
            pose=self.make("geometry_msgs/msg/PoseWithCovariance", pose=inner, covariance=unsure),
            twist=self.make("geometry_msgs/msg/TwistWithCovariance", twist=still, covariance=unsure),
        )

    def write(self, path: Path, messages, storage: str = "SQLITE3", packing: str = "") -> None:
        """(topic, nanoseconds of the recording, message) in a .bag or a folder."""
        from rosbags.rosbag1 import Writer as Writer1
        from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
        from rosbags.rosbag2 import Writer as Writer2

        path.parent.mkdir(parents=True, exist_ok=True)
        if self.ros1:
            writer = Writer1(path)
            if packing:
                writer.set_compression(Writer1.CompressionFormat[packing])
        else:
            writer = Writer2(path, version=9, storage_plugin=StoragePlugin[storage])
            if packing:
                writer.set_compression(CompressionMode[packing], CompressionFormat.ZSTD)
        with writer:
            topics = {}
            for topic, time, message in messages:
                kind = message.__msgtype__
                if topic not in topics:
                    topics[topic] = writer.add_connection(topic, kind, typestore=self.store)
                pack = self.store.serialize_ros1 if self.ros1 else self.store.serialize_cdr
                writer.write(topics[topic], time, pack(message, kind))


ROS_START = 1_700_000_000_123_456_789
# the camera on a robot: x of the base is forward, z is up
BASE_FROM_OPTICAL = np.array([[0.0, 0, 1, 0.2], [-1, 0, 0, 0.05], [0, -1, 0, 1.1], [0, 0, 0, 1]])


def ros_stamps() -> list[int]:
    return [ROS_START + 400_000_000 * i for i in range(COUNT)]


def int_K33(made: Made) -> np.ndarray:
    return int_K44(made)[:3, :3]


def ros1(root: Path, made: Made) -> None:
    """Raw pictures, depth in millimetres, a robot in /tf with its camera in /tf_static; recorded later than stamped."""
    ros, messages = RosMessages(True), []
    fixed = ros.transform("base_link", "optical", ROS_START, BASE_FROM_OPTICAL)
    messages.append(("/tf_static", ROS_START, ros.transforms(fixed)))
    for i, (pose, stamp) in enumerate(zip(made.poses, ros_stamps(), strict=True)):
        time = stamp + 30_000_000
        base = ros.transform("/odom", "/base_link", stamp, pose @ np.linalg.inv(BASE_FROM_OPTICAL))
        messages.append(("/tf", time, ros.transforms(base)))
        info = ros.info("optical", stamp, int_K33(made))
        messages.append(("/camera/color/camera_info", time, info))
        messages.append(("/camera/color/image_raw", time, ros.image("optical", stamp, made.photos[i], "bgr8", pad=5)))
        messages.append(("/camera/aligned_depth/camera_info", time, info))
        messages.append(("/camera/aligned_depth/image_raw", time, ros.image("optical", stamp, made.depths[i], "16UC1")))
    ros.write(root / "walk.bag", messages, packing="LZ4")


def ros2(root: Path, made: Made) -> None:
    """Packed pictures, depth in metres, odometry of the robot; each message packed too."""
    ros, messages = RosMessages(False), []
    fixed = ros.transform("base_link", "optical", ROS_START, BASE_FROM_OPTICAL)
    messages.append(("/tf_static", ROS_START, ros.transforms(fixed)))
    for i, (pose, stamp) in enumerate(zip(made.poses, ros_stamps(), strict=True)):
        base = pose @ np.linalg.inv(BASE_FROM_OPTICAL)
        metres = np.where(made.depths[i] > 0, made.depths[i] / 1000, np.nan).astype(np.float32)
        photo = cv2.imencode(".png", made.photos[i])[1].tobytes()
        info = ros.info("optical", stamp, int_K33(made))
        messages += [
            ("/odom", stamp, ros.odometry("odom", "base_link", stamp, base)),
            ("/rgb/image/compressed", stamp, ros.packed("optical", stamp, photo, "bgr8; png compressed bgr8")),
            ("/rgb/camera_info", stamp, info),
            ("/depth/image", stamp + 9_000_000, ros.image("optical", stamp + 9_000_000, metres, "32FC1")),
            ("/depth/camera_info", stamp, info),
        ]
    root.mkdir(parents=True)
    ros.write(root / "walk", messages, packing="MESSAGE")
    for path in (root / "walk").iterdir():
        path.rename(root / path.name)
    (root / "walk").rmdir()


def ros_mcap(root: Path, made: Made) -> None:
    """Poses that do not say whose they are; depth as compressedDepth has it: 12 bytes, then a PNG."""
    ros, messages = RosMessages(False), []
    for i, (pose, stamp) in enumerate(zip(made.poses, ros_stamps(), strict=True)):
        depth = struct.pack("<i2f", 0, 0.0, 0.0) + cv2.imencode(".png", made.depths[i])[1].tobytes()
        messages += [
            ("/vicon/pose", stamp, ros.pose("world", stamp, pose)),
            ("/camera/image_raw", stamp, ros.image("optical", stamp, made.photos[i][..., ::-1], "rgb8")),
            ("/camera/camera_info", stamp, ros.info("optical", stamp, int_K33(made))),
            ("/camera/depth/compressedDepth", stamp, ros.packed("optical", stamp, depth, "16UC1; compressedDepth")),
        ]
    ros.write(root, messages, "MCAP", packing="STORAGE")


LAYOUTS: dict[str, Callable[[Path, Made], None]] = {
    function.__name__: function
    for function in (
        scannet,
        scannet_frames,
        scannet_flat,
        sens,
        colmap,
        colmap_binary,
        nerfstudio,
        instant_ngp,
        scannetpp_dslr,
        scannetpp_json,
        scannetpp_iphone,
        replica,
        tum,
        sevenscenes,
        neuralrgbd,
        monosdf,
        sdfstudio,
        polycam,
        polycam_zip,
        record3d,
        record3d_archive,
        stray,
        arkitscenes,
        open3d,
        metashape,
        ros1,
        ros2,
        ros_mcap,
    )
}


@pytest.fixture
def written(tmp_path: Path, made: Made):
    """`written(name)` gives the folder of the made scene in a layout; `written(name, made=other)` of another."""

    def write(name: str, **changes) -> Path:
        root = tmp_path / name
        LAYOUTS[name](root, changes.get("made", made))
        return root

    return write


@pytest.fixture
def colmap_writer():
    """`colmap_writer(folder, made, names, camera, poses)` writes a text model."""
    return colmap_text


@pytest.fixture
def settings(default_config):
    """`settings(path, **changes)` gives a SceneConfig with nothing held out."""
    return lambda path, **changes: replace(default_config.scene, **{"path": str(path), "test_every": 0, **changes})


@pytest.fixture
def ros_messages():
    """`ros_messages(ros1)` makes messages and bags."""
    return RosMessages
