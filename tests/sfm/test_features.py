"""Features of a photo do not depend on the photos before it, nor on threads."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from room2dgs.colmap import pycolmap
from room2dgs.sfm.features import extract_each
from room2dgs.sfm.matching import quiet

WIDTH, HEIGHT = 160, 120
NAMES = ("dot.bmp", "room.bmp", "plain.bmp", "again.bmp")


def photos() -> list[np.ndarray]:
    """One with a fine dot, whose features are all in the finest octave; one of blurred noise; one of nothing."""
    dot = np.zeros((HEIGHT, WIDTH), np.float32)
    dot[60, 80] = 1
    dot = cv2.GaussianBlur(dot, (0, 0), 1.2)
    dot = (100 + 150 * dot / dot.max()).astype(np.uint8)
    noise = np.random.default_rng(5).uniform(0, 255, (HEIGHT // 4, WIDTH // 4)).astype(np.uint8)
    room = cv2.resize(noise, (WIDTH, HEIGHT), interpolation=cv2.INTER_CUBIC)
    return [dot, room, np.full_like(dot, 90), room]


@pytest.fixture
def extracted(tmp_path):
    def run(names: tuple[str, ...], threads: int) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        folder = tmp_path / f"{len(list(tmp_path.iterdir()))}"
        (folder / "images").mkdir(parents=True)
        path = folder / "database.db"
        with pycolmap.Database.open(path) as database:
            camera = pycolmap.Camera(
                model="PINHOLE", width=WIDTH, height=HEIGHT, params=[130.0, 130.0, WIDTH / 2, HEIGHT / 2]
            )
            camera_id = database.write_camera(camera)
            rig = pycolmap.Rig()
            rig.add_ref_sensor(pycolmap.sensor_t(pycolmap.SensorType.CAMERA, camera_id))
            database.write_rig(rig)
            for name, photo in zip(NAMES, photos(), strict=True):
                if name in names:
                    cv2.imwrite(str(folder / "images" / name), photo)
                    database.write_image(pycolmap.Image(name=name, camera_id=camera_id))
        with quiet():
            extract_each(path, folder / "images", names, pycolmap.FeatureExtractionOptions(), threads)
        assert sorted(one.name for one in folder.iterdir()) == ["database.db", "images"]
        return {name: features(path, name) for name in names}

    return run


def features(database: Path, name: str) -> tuple[np.ndarray, np.ndarray]:
    with pycolmap.Database.open(database) as opened:
        image_id = opened.read_image_with_name(name).image_id
        return opened.read_keypoints(image_id), opened.read_descriptors(image_id).data


@pytest.mark.parametrize("threads", [1, 2, 3])
def test_a_photo_has_the_features_that_it_has_alone(extracted, threads):
    together = extracted(NAMES, threads)
    assert len(together["dot.bmp"][0]) > 0
    assert len(together["room.bmp"][0]) > 50
    for name in NAMES:
        (alone,) = extracted((name,), 1).values()
        for found, wanted in zip(together[name], alone, strict=True):
            assert np.array_equal(found, wanted), name
