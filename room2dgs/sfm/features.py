"""SIFT features of photos, each extracted as if it were the only one.

pycolmap's extractor for the CPU keeps one filter a thread from photo to photo. Where the features of a photo all lie in
its finest octave, the filter takes the next photo's gradients of that octave for known: orientations and descriptors
are then the previous photo's, and which photo that is depends on how the threads ran. So a filter sees one photo here.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Sequence
from pathlib import Path
from queue import Queue

import numpy as np

from room2dgs.colmap import pycolmap
from room2dgs.parallel_map import parallel_map


def extract_each(
    database: Path,
    images: Path,
    names: Sequence[str],
    options: pycolmap.FeatureExtractionOptions,
    threads: int,
    reader: pycolmap.ImageReaderOptions | None = None,
    done: Callable[[int], None] = lambda count: None,
) -> None:
    """Write keypoints and descriptors of some photos into a database that knows these photos.

    Args:
        images: folder of the photos.
        names: of the photos, in the database and in the folder.
        options: of the extraction; their number of threads is not used.
        threads: photos that are worked on at once.
        reader: where masks lie.
        done: told how many photos are done, after each.
    """
    options.num_threads = 1
    reader = reader or pycolmap.ImageReaderOptions()
    count = max(1, min(threads, len(names)))
    with pycolmap.Database.open(database) as of_all:
        image_ids = {image.name: image.image_id for image in of_all.read_all_images()}
    # SQLite lets one thread write at a time, so each works on a copy that knows the photos
    copies: Queue[Path] = Queue()
    for number in range(count):
        copies.put(Path(shutil.copyfile(database, database.with_name(f"{database.name}.{number}"))))

    def extract(name: str) -> tuple[int, np.ndarray, pycolmap.FeatureDescriptors]:
        copy = copies.get()
        try:
            pycolmap.extract_features(
                copy,
                images,
                image_names=[name],
                reader_options=reader,
                extraction_options=options,
                device=pycolmap.Device.cpu,
            )
            with pycolmap.Database.open(copy) as of_copy:
                image_id = image_ids[name]
                return image_id, of_copy.read_keypoints(image_id), of_copy.read_descriptors(image_id)
        finally:
            copies.put(copy)

    try:
        with pycolmap.Database.open(database) as of_all:
            for number, (image_id, keypoints, descriptors) in enumerate(parallel_map(extract, names, count), 1):
                of_all.write_keypoints(image_id, keypoints)
                of_all.write_descriptors(image_id, descriptors)
                done(number)
    finally:
        while not copies.empty():
            copies.get().unlink(missing_ok=True)
