"""Images of strangers: which files are opened, as what, and how large; each fault has its own sentence."""

from __future__ import annotations

import ast
import os
import struct
import subprocess
import sys
import zlib
from io import BytesIO
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from room2dgs.captures import listing, opened_images
from room2dgs.captures.depth_maps import depth_file
from room2dgs.captures.image_files import check_photo, color_size, depth_size, read_photo
from room2dgs.captures.listing import photos_in, unread_photos
from room2dgs.captures.photos import PhotoFile
from room2dgs.captures.read import read_scene
from room2dgs.errors import InputError
from tests.captures.heic_file import HEIC

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def photo(tmp_path) -> Path:
    path = tmp_path / "photo.jpg"
    pixels = np.random.default_rng(0).integers(0, 255, (48, 64, 3), np.uint8)
    Image.fromarray(cv2.resize(pixels, (64, 48))).save(path, quality=95)
    return path


def sentence(path: Path, read=check_photo) -> str:
    with pytest.raises(InputError) as caught:
        read(path)
    assert "\n" not in str(caught.value) and path.name in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize("read", [check_photo, color_size, lambda path: read_photo(path, None)])
def test_postscript_is_not_run_whatever_its_name(tmp_path, monkeypatch, read):
    path = tmp_path / "photo.jpg"
    path.write_bytes(b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 64 48\n%%EndComments\nshowpage\n%%EOF\n")
    monkeypatch.setattr("PIL.EpsImagePlugin.Ghostscript", lambda *_, **__: pytest.fail("Ghostscript was started"))
    monkeypatch.setattr(subprocess, "check_call", lambda *_, **__: pytest.fail("a program was started"))
    assert 'it is not an image (it begins "%!PS-Adobe-3.0 E")' in sentence(path, read)


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (b"no image, a text\n", 'it is not an image (it begins "no image, a text")'),
        (b"%PDF-1.4\n%\xe2\xe3\xcf\xd3\n", "it is not an image (it begins 25 50 44 46 2d 31 2e 34)"),
        (b"\x00\x01\x02\x03" * 9, "it is not an image (it begins 00 01 02 03 00 01 02 03)"),
        (b"\x1b[31mred", "it is not an image (it begins 1b 5b 33 31 6d 72 65 64)"),
        (b"", "it is empty (0 bytes)"),
        (b"\xff\xd8\xff\xe0", "this JPEG ends too early"),
        (b"\x89PNG\r\n\x1a\n" + bytes(40) + b"IEND", "this PNG is damaged"),
    ],
)
def test_what_is_no_image_is_told_by_how_it_begins(tmp_path, content, told):
    path = tmp_path / "photo.jpg"
    path.write_bytes(content)
    for read in (check_photo, color_size, lambda path: read_photo(path, None)):
        assert told in sentence(path, read)


def test_files_that_are_not_there_or_no_files(tmp_path, photo):
    assert "is missing; copy" in sentence(tmp_path / "gone.jpg")
    assert "photo.jpg is there beside it, which differs in upper and lower case" in sentence(tmp_path / "PHOTO.JPG")
    photo.rename(tmp_path / "cafe\u0301.jpg")
    assert "another Unicode form" in sentence(tmp_path / "caf\u00e9.jpg")
    (tmp_path / "dead.jpg").symlink_to(tmp_path / "nothing")
    assert "is a link to" in sentence(tmp_path / "dead.jpg")
    (tmp_path / "folder.jpg").mkdir()
    assert "is a folder where a file belongs" in sentence(tmp_path / "folder.jpg")
    os.mkfifo(tmp_path / "pipe.jpg")
    for read in (
        check_photo,
        color_size,
        lambda path: PhotoFile(path).digest(),
        lambda path: depth_file(path).metres(),
    ):
        assert "is a pipe where a file belongs" in sentence(tmp_path / "pipe.jpg", read)


def test_a_png_that_is_named_jpg_is_read(tmp_path, photo):
    path = tmp_path / "other.jpg"
    Image.open(photo).save(path, "PNG")
    assert color_size(path) == (64, 48) and np.array_equal(read_photo(path, None), read_photo(photo, None))


@pytest.mark.parametrize("kind", ["JPEG", "PNG", "TIFF", "WEBP", "BMP", "GIF", "PPM", "MPO"])
def test_formats_of_photos(tmp_path, photo, kind):
    buffer = BytesIO()
    Image.open(photo).save(buffer, kind)
    (tmp_path / "photo").write_bytes(buffer.getvalue())
    check_photo(tmp_path / "photo")
    assert read_photo(tmp_path / "photo", None).shape == (48, 64, 3)


def test_a_photo_cut_anywhere_ends_too_early(photo):
    data = photo.read_bytes()
    for length in (10, 200, len(data) // 2, len(data) - 3):
        photo.write_bytes(data[:length])
        assert "this JPEG ends too early; copy it again" in sentence(photo)


def blank_png(path: Path, width: int, height: int, bits: int = 16) -> Path:
    """Of zeros, which pack to a thousandth."""
    packer, rows = zlib.compressobj(1), bytes((1 + width * bits // 8) * 100)
    data = b"".join(packer.compress(rows) for _ in range(height // 100)) + packer.flush()
    chunks = [(b"IHDR", struct.pack(">IIBBBBB", width, height, bits, 0, 0, 0, 0)), (b"IDAT", data), (b"IEND", b"")]
    text = b"".join(
        struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body)) for name, body in chunks
    )
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + text)
    return path


@pytest.mark.parametrize("side", [6_000, 13_000, 100_000])
def test_a_depth_map_of_too_many_pixels_is_refused_by_its_header(tmp_path, side):
    path = blank_png(tmp_path / "bomb.png", side, 100)  # the rest is missing: nobody may look for it
    data = bytearray(path.read_bytes())
    data[20:24] = struct.pack(">I", side)
    data[29:33] = struct.pack(">I", zlib.crc32(data[12:29]))
    path.write_bytes(data)
    assert "million are read at most" in sentence(path, lambda path: depth_file(path).metres())
    assert depth_size(path) is None
    if side > 6_000:
        assert "million are read at most" in sentence(path)


def test_a_large_photo_is_read_if_its_file_is_large_too(tmp_path):
    path = tmp_path / "large.tiff"
    Image.new("1", (9_000, 9_000)).save(path, compression="group4")
    assert "9000x9000 pixels, and 64 million are read at most of such a file" in sentence(path, color_size)
    with path.open("ab") as file:
        file.truncate(9_000 * 9_000 // 32 + 1)
    assert color_size(path) == (9_000, 9_000)


@pytest.mark.slow
def test_a_depth_map_as_large_as_may_be_takes_bounded_memory(tmp_path):
    path = blank_png(tmp_path / "large.png", 7_600, 4_400)
    # not ru_maxrss, which a child inherits from whoever started it
    code = (
        "from pathlib import Path; from room2dgs.captures.depth_maps import depth_file\n"
        "peak = lambda: int(open('/proc/self/status').read().partition('VmHWM:')[2].split()[0]) >> 10\n"
        f"before, depth = peak(), depth_file(Path({str(path)!r})).metres()\n"
        "assert depth.shape == (4400, 7600)\n"
        "print(peak() - before)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert int(done.stdout) < 700  # MiB


@pytest.mark.parametrize(("kind", "dtype"), [("png", np.uint16), ("tiff", np.uint16), ("tiff", np.float32)])
def test_numbers_of_a_depth_map_are_those_that_are_stored(tmp_path, kind, dtype):
    stored = np.random.default_rng(1).integers(0, 65535, (48, 64)).astype(dtype) / dtype(1)
    stored = stored.astype(dtype)
    path = tmp_path / f"depth.{kind}"
    assert cv2.imwrite(str(path), stored)
    found = depth_file(path, 0.001)
    assert found.size() == (64, 48)
    np.testing.assert_array_equal(found.metres(), stored.astype(np.float32) * np.float32(0.001))


def test_a_truncated_depth_map_is_not_filled_up(tmp_path):
    path = tmp_path / "depth.png"
    cv2.imwrite(str(path), np.random.default_rng(1).integers(0, 65535, (48, 64)).astype(np.uint16))
    path.write_bytes(path.read_bytes()[:2000])
    assert "this PNG ends too early" in sentence(path, lambda path: depth_file(path).metres())


@pytest.mark.parametrize(
    "array",
    [
        np.zeros((0, 5), np.float32), np.zeros((5, 0)), np.zeros((2, 3, 4), np.float32), np.zeros(7),
        np.array([[{}]], dtype=object), np.zeros((3, 4), bool), np.zeros((3, 4), complex), np.array(["a"]),
        np.float32(3),
    ],
)  # fmt: skip
def test_arrays_that_are_no_depth_maps(tmp_path, array):
    path = tmp_path / "depth.npy"
    np.save(path, array, allow_pickle=True)
    told = sentence(path, lambda path: depth_file(path).metres())
    assert "no depth map" in told or "cannot be read as a depth map" in told
    assert depth_file(path).size() is None


def test_an_array_that_claims_more_than_its_file_has(tmp_path):
    path = tmp_path / "depth.npy"
    np.save(path, np.zeros((4, 5), np.float32))
    for shape in (b"(9, 5)", b"(999999999, 999999999)"):
        data = path.read_bytes().replace(b"(4, 5)", shape)
        path.write_bytes(data)
        assert "cannot be read as a depth map" in sentence(path, lambda path: depth_file(path).metres())
        path.write_bytes(data.replace(shape, b"(4, 5)"))
    np.save(path, np.full((1, 4, 5, 1), 2, np.float32))
    assert depth_file(path, 1.0).size() == (5, 4) and (depth_file(path, 1.0).metres() == 2).all()


def test_heic_is_read_and_counted_where_it_is_not(tmp_path, monkeypatch, photo):
    heic = tmp_path / "IMG_1.HEIC"
    heic.write_bytes(HEIC)
    y, x = np.mgrid[:48, :64]
    pixels = read_photo(heic, None)
    assert np.abs(pixels - np.stack([4 * x, 5 * y, 0 * x + 90], axis=-1)).mean() < 3
    assert photos_in(tmp_path) == ["IMG_1.HEIC", "photo.jpg"] and unread_photos(tmp_path) is None
    (tmp_path / "IMG_1.jpg").write_bytes(photo.read_bytes())
    assert photos_in(tmp_path) == ["IMG_1.jpg", "photo.jpg"]  # converted: the same photo
    (tmp_path / "IMG_1.jpg").unlink()

    damaged = tmp_path / "IMG_9.heic"
    damaged.write_bytes(HEIC[:60] + bytes(400))
    assert photos_in(tmp_path) == ["IMG_1.HEIC", "photo.jpg"]
    assert unread_photos(tmp_path).startswith(f"1 file in {tmp_path} is HEIC, which is not read; none of them can be")
    damaged.unlink()

    without = lambda: False  # noqa: E731
    monkeypatch.setattr(listing, "heic_is_read", without)
    monkeypatch.setattr(listing, "PHOTO_SUFFIXES", (".jpg", ".png"))
    monkeypatch.setattr(opened_images, "heic_is_read", without)
    opened_images.formats.cache_clear()
    try:
        assert "is HEIC, which is not read; install room2dgs[heic] or convert it to JPEG" in sentence(heic)
    finally:
        opened_images.formats.cache_clear()
    for number in range(2, 8):
        (tmp_path / f"IMG_{number}.heic").write_bytes(HEIC)
    told = unread_photos(tmp_path)
    assert told == f"7 files in {tmp_path} are HEIC, which is not read; install room2dgs[heic] or convert them"
    (tmp_path / "photo.dng").write_bytes(b"II*\0")  # beside photo.jpg: the same photo
    assert unread_photos(tmp_path) == told
    (tmp_path / "a.dng").write_bytes(b"II*\0")
    assert unread_photos(tmp_path).startswith(f"1 file in {tmp_path} is .dng, 7 HEIC, which is not read; convert")


def test_photos_that_are_passed_over_are_told_in_a_capture(written, settings):
    root = written("nerfstudio")
    assert not any("not read" in text for text in read_scene(settings(root)).warnings)
    for number in range(3):
        (root / f"images/more_{number}.CR2").write_bytes(b"II*\0")
    told = [text for text in read_scene(settings(root)).warnings if "not read" in text]
    assert told == [f"3 files in {root / 'images'} are .cr2, which is not read; convert them to JPEG or PNG"]


OPENERS = {"Image.open", "cv2.imread", "cv2.imreadmulti", "cv2.imdecode", "cv2.VideoCapture", "imageio.imread"}
OPEN_IMAGES = {"captures/opened_images.py", "captures/image_files.py", "captures/video.py"}
OF_OUR_OWN = {"export/texture/write.py"}  # a JPEG that was encoded on the line before


def test_images_and_videos_are_opened_in_one_place():
    found = set()
    for top in (ROOT / "room2dgs", ROOT / "eval"):
        for path in top.rglob("*.py"):
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if isinstance(node, ast.Call) and ast.unparse(node.func) in OPENERS:
                    found.add(path.relative_to(top).as_posix())
    assert found == OPEN_IMAGES | OF_OUR_OWN


@pytest.mark.parametrize(
    ("head", "kind"),
    [
        (b"\0\0\0\x0cjP  \r\n\x87\n", "JPEG 2000"),
        (b"\0\0\0\x1cftypavif\0\0\0\0avifmif1miaf", "AVIF"),
        (b"\0\0\0\x1cftypmif1\0\0\0\0mif1avif", "AVIF"),
        (b"\xff\x0a\xfa\x1f", "JPEG XL"),
        (b"8BPS\0\1", "Photoshop's PSD"),
        (b"v/1\x01\2\0\0\0", "OpenEXR"),
    ],
)
def test_images_of_formats_that_are_not_read_are_called_by_their_names(tmp_path, head, kind):
    path = tmp_path / "photo.jpg"
    path.write_bytes(head + bytes(100))
    with pytest.raises(InputError, match=f"is {kind}, which is not read as a photo; convert it"):
        check_photo(path)


def test_a_kind_that_the_decoder_does_not_know_is_told_without_its_objects(tmp_path):
    path = tmp_path / "photo.tif"
    cv2.imwrite(str(path), np.zeros((4, 4, 3), np.float32))
    with pytest.raises(InputError, match="this TIFF is damaged or of a kind that is not read") as caught:
        check_photo(path)
    assert "<" not in str(caught.value)
