"""Files that say more than they hold, or hold more than they should: one sentence, in little time and memory."""

from __future__ import annotations

import io
import os
import struct
import time
import tracemalloc
import zipfile
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import liblzfse
import numpy as np
import OpenEXR
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from room2dgs.captures import archives, lzfse, xml_files
from room2dgs.captures.archives import Archive
from room2dgs.captures.exr_files import exr_size, read_exr
from room2dgs.captures.lzfse import unpacked_lzfse
from room2dgs.captures.matrix_files import read_world_from_cam
from room2dgs.captures.point_files import read_ply
from room2dgs.captures.read import read_scene
from room2dgs.captures.readers.scannetpp_depth import HEIGHT, WIDTH, DepthStream
from room2dgs.captures.text_files import floats, lines_of, read_json, text_of
from room2dgs.captures.xml_files import read_xml
from room2dgs.errors import InputError

MIB = 1 << 20


@contextmanager
def bounded(memory: int, seconds: float = 5.0) -> Iterator[None]:
    """Python's own memory; the time is for a machine that does other things too."""
    start = time.process_time()
    tracemalloc.start()
    try:
        yield
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < memory, f"{peak >> 20} MiB"
    assert time.process_time() - start < seconds


def refused(read: Callable, *arguments) -> str:
    with pytest.raises(InputError) as caught:
        read(*arguments)
    assert "\n" not in str(caught.value)
    return str(caught.value)


# ---- text


@pytest.mark.parametrize("read", [read_world_from_cam, lines_of, read_json, read_xml])
def test_text_comes_from_regular_files_alone(tmp_path, read):
    os.mkfifo(tmp_path / "pipe")
    assert "is a pipe where a file belongs" in refused(read, tmp_path / "pipe")
    assert "is a device where a file belongs" in refused(read, Path("/dev/zero"))
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    assert "a link that leads back to itself" in refused(read, tmp_path / "loop")
    assert "is missing" in refused(read, tmp_path / "gone")


def test_large_text_is_not_read(tmp_path):
    path = tmp_path / "pose.txt"
    with path.open("wb") as file:
        file.truncate(50 * MIB)
    with bounded(MIB):
        assert "more than 64 KiB, too large for a 4x4 matrix" in refused(read_world_from_cam, path)
    with path.open("wb") as file:
        file.truncate(3 << 30)
    with bounded(MIB):
        for read in (lines_of, read_json, text_of, read_xml):
            assert "3072 MiB, too large for what it should hold" in refused(read, path)


def test_lines_and_numbers_are_counted_before_they_are_made(tmp_path):
    path = tmp_path / "traj.txt"
    path.write_bytes(b"0\n" * 2_000_000)
    with bounded(20 * MIB):
        assert "more than 1,000,000 lines" in refused(lines_of, path)
    line = "1 " * 5_000_000
    with bounded(MIB):
        assert "letters where 16 numbers belong" in refused(floats, line, path, 1, 16)


def test_lines_end_as_they_always_did(tmp_path):
    path = tmp_path / "list.txt"
    path.write_bytes(b"\xef\xbb\xbf# comment\r\n a b \r\rc\n\n  # more\nd")
    assert lines_of(path) == [(2, "a b"), (4, "c"), (7, "d")]


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (b" " * 50_000_000, "is no JSON"),
        (b"[" * 3_000_000, "is no JSON"),
        (b"[" + b"{}," * 3_000_000 + b"0]", "more than 4,000,000 values"),
        (b'{"a":' * 200_000, "is no JSON"),
        (b"9" * 100_000, "is no JSON"),
    ],
)
def test_json_of_blanks_brackets_and_digits(tmp_path, text, told):
    path = tmp_path / "transforms.json"
    path.write_bytes(text)
    with bounded(4 * len(text) + 4 * MIB):
        assert told in refused(read_json, path)
        assert told in refused(read_json, path, text)


def test_xml_of_many_or_deep_elements(tmp_path, monkeypatch):
    path = tmp_path / "cameras.xml"
    path.write_text("<a>" * 1_000_000)
    with bounded(20 * MIB):
        assert "nested more than 64 deep" in refused(read_xml, path)
    monkeypatch.setattr(xml_files, "MAX_ELEMENTS", 1000)
    path.write_text("<a>" + "<b/>" * 2000 + "</a>")
    assert "more than 1,000 XML elements" in refused(read_xml, path)
    path.write_text('<!DOCTYPE x [<!ENTITY a "aaaa">]><x>&a;</x>')
    assert "declares a document type or entities" in refused(read_xml, path)
    path.write_text("<a><b>1</b>")
    assert "no whole XML" in refused(read_xml, path)
    path.write_text("<a x='1'><b>1</b>2</a>")
    assert read_xml(path).findtext("b") == "1" and read_xml(path)[0].tail == "2"


# ---- archives


def test_a_zip_with_many_other_files_is_listed_once(tmp_path, monkeypatch):
    path = tmp_path / "room.r3d"
    with zipfile.ZipFile(path, "w") as archive:
        for index in range(20_000):
            archive.writestr(f"other/{index}", b"")
        for name, method in (("stored", 0), ("deflated", 8), ("bzipped", 12)):
            archive.writestr(f"room/rgbd/{name}", name.encode() * 99, compress_type=method)
    found = Archive(path, "rgbd/")
    assert found.names == {"rgbd/stored", "rgbd/deflated", "rgbd/bzipped"}
    with bounded(MIB, 1.0):
        for _ in range(200):
            for name in ("stored", "deflated"):
                assert found.read(f"rgbd/{name}") == name.encode() * 99
    assert found.read("rgbd/bzipped") == b"bzipped" * 99
    monkeypatch.setattr(archives, "MAX_DIRECTORY_BYTES", 1 << 16)
    with bounded(MIB, 1.0):
        assert "lists more files than a capture has" in refused(Archive, path, "rgbd/")


def test_zip_entries_that_lie(tmp_path):
    path = tmp_path / "room.zip"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("keyframes/x", b"hello" * 100)
    whole = path.read_bytes()
    directory = whole.index(b"PK\1\2")
    for place, form, value, told in (
        (directory + 24, "<I", 3, "not as large as it says"),  # more than announced
        (directory + 24, "<I", 9999, "not as large as it says"),
        (directory + 16, "<I", 1, "has a damaged keyframes/x"),  # CRC
        (directory + 42, "<I", 5, "has a damaged keyframes/x"),  # place
        (directory + 8, "<H", 1, "has a damaged keyframes/x"),  # encrypted
        (directory + 10, "<H", 77, "has a damaged keyframes/x"),  # method
        (directory + 20, "<I", (1 << 32) - 2, "4095 MiB|damaged|500"),
    ):
        data = bytearray(whole)
        struct.pack_into(form, data, place, value)
        path.write_bytes(data)
        said = refused(lambda: Archive(path, "keyframes/").read("keyframes/x"))
        assert any(word in said for word in told.split("|")) or "too large" in said or "MiB" in said
    path.write_bytes(whole)
    assert Archive(path, "keyframes/").read("keyframes/x") == b"hello" * 100
    os.mkfifo(tmp_path / "pipe.zip")
    assert "is a pipe" in refused(Archive, tmp_path / "pipe.zip")


@settings(max_examples=150, deadline=None, suppress_health_check=list(HealthCheck), derandomize=True)
@given(st.data())
def test_zips_with_damage_anywhere(tmp_path, data):
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("keyframes/a", b"hello" * 50)
        archive.writestr("keyframes/b", b"world" * 50)
    raw = bytearray(buffer.getvalue())
    place = data.draw(st.integers(0, len(raw) - 4))
    raw[place : place + 4] = data.draw(st.binary(min_size=4, max_size=4))
    (tmp_path / "a.zip").write_bytes(raw)
    try:
        found = Archive(tmp_path / "a.zip", "keyframes/")
        for name in found.names:
            assert found.read(name) in (b"hello" * 50, b"world" * 50)
    except InputError as error:
        assert "\n" not in str(error)


# ---- depth


def test_lzfse_is_unpacked_to_its_size_and_no_further():
    depth = np.random.default_rng(0).random((48, 64)).astype("<f4").tobytes()
    packed = liblzfse.compress(depth)
    assert unpacked_lzfse(packed, len(depth), "a") == depth
    bomb = liblzfse.compress(bytes(40 * MIB))
    assert len(bomb) < MIB // 8
    with bounded(MIB, 0.5):
        assert "unpacks to more where 12288 belong" in refused(unpacked_lzfse, bomb, len(depth), "a.r3d (rgbd/0.depth)")
    for wrong in (b"", packed[:100], packed[:-4], b"bvx2" + bytes(40), b"no such thing"):
        assert "damaged" in (said := refused(unpacked_lzfse, wrong, len(depth), "a")) or "unpacks to" in said
    assert "unpacks to 12288 bytes where 12292 belong" in refused(unpacked_lzfse, packed, len(depth) + 4, "a")
    assert "too large for a depth map" in refused(unpacked_lzfse, packed, 1 << 30, "a")


def test_without_lzfse_a_sentence_names_what_to_install(monkeypatch):
    monkeypatch.setattr(lzfse, "_decoder", lambda: None)
    assert "pip install 'room2dgs[phones]'" in refused(unpacked_lzfse, b"", 4, "a")


def exr(path: Path, header: dict | None = None, **channels: np.ndarray) -> Path:
    known = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, **(header or {})}
    OpenEXR.File(known, channels).write(str(path))
    return path


@pytest.mark.parametrize("name", ["R", "Y", "Z", "depth", "whatever"])
@pytest.mark.parametrize("kind", [np.float16, np.float32])
def test_depth_in_exr(tmp_path, name, kind):
    values = np.random.default_rng(0).uniform(0.5, 4, (48, 64)).astype(kind)
    path = exr(tmp_path / "0.exr", **{name: values})
    assert exr_size(path) == (64, 48)
    np.testing.assert_array_equal(read_exr(path), values.astype(np.float32))


def test_exr_of_several_channels(tmp_path):
    values = np.random.default_rng(0).uniform(0.5, 4, (48, 64)).astype(np.float32)
    path = exr(tmp_path / "0.exr", A=values * 0, B=values * 2, G=values * 3, R=values)
    np.testing.assert_array_equal(read_exr(path), values)
    path = exr(tmp_path / "0.exr", left=values, right=values)
    assert "has channels left, right, none of them depth" in refused(read_exr, path)
    path = exr(tmp_path / "0.exr", R=np.ones((48, 64), np.uint32))
    assert "holds no floats" in refused(read_exr, path)


def test_exr_whose_data_are_a_part_of_the_picture(tmp_path):
    values = np.random.default_rng(0).uniform(0.5, 4, (10, 20)).astype(np.float32)
    box = (np.array([4, 6], np.int32), np.array([23, 15], np.int32))
    shown = (np.array([0, 0], np.int32), np.array([63, 47], np.int32))
    path = exr(tmp_path / "0.exr", {"dataWindow": box, "displayWindow": shown}, Z=values)
    found = read_exr(path)
    assert found.shape == (48, 64) and np.array_equal(found[6:16, 4:24], values)
    assert np.count_nonzero(found) == values.size


def test_exr_that_is_none_damaged_or_too_large(tmp_path, monkeypatch):
    values = np.random.default_rng(0).uniform(0.5, 4, (48, 64)).astype(np.float32)
    path = exr(tmp_path / "0.exr", Z=values)
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    assert "cannot be decoded as a depth map" in refused(read_exr, path)
    place = whole.index(b"dataWindow\0box2i\0") + 17 + 4
    path.write_bytes(whole[:place] + struct.pack("<4i", 0, 0, 99_999, 99_999) + whole[place + 16 :])
    with bounded(MIB):
        assert "100000x100000 pixels, and 32 million are read at most" in refused(read_exr, path)
    path.write_bytes(b"no exr")
    assert 'is no OpenEXR file (it begins "no exr")' in refused(read_exr, path)
    os.mkfifo(tmp_path / "pipe.exr")
    assert "is a pipe" in refused(read_exr, tmp_path / "pipe.exr")
    path.write_bytes(whole)
    monkeypatch.setitem(__import__("sys").modules, "OpenEXR", None)
    assert "install OpenEXR (pip install OpenEXR) to read it" in refused(read_exr, path)


def test_record3d_with_exr_depth(written, settings, made):
    root = written("record3d")
    (root / "depth").mkdir(exist_ok=True)
    for index in range(len(made.depths)):
        exr(root / f"depth/{index}.exr", R=made.depths[index] / np.float32(1000))
    frames = read_scene(settings(root)).frames
    assert len(frames) == len(made.depths)
    for frame, depth in zip(frames, made.depths, strict=True):
        assert np.abs(frame.depth() - depth / 1000).max() < 5e-7


def test_frames_of_one_deflate_stream_in_any_order(tmp_path):
    levels = np.arange(150, dtype=np.float32)
    packer = zlib.compressobj(1, zlib.DEFLATED, -zlib.MAX_WBITS)
    parts = [packer.compress(np.full((HEIGHT, WIDTH), level, np.float32).tobytes()) for level in levels]
    path = tmp_path / "depth.bin"
    path.write_bytes(b"".join(parts) + packer.flush())
    stream = DepthStream(path)
    taken = []
    monitor = stream._unpacked
    stream._unpacked = lambda size: (taken.append(size), monitor(size))[1]
    for index in [149, *range(148, 128, -1), 0, 140, 70, 149]:
        assert (stream.frame(index) == levels[index]).all()
    assert len(taken) < 150 + 24 * 64 // 2 + 64  # from the start each time: over 3,000
    assert "cannot be unpacked up to frame 150" in refused(stream.frame, 150)
    assert (stream.frame(3) == 3).all()


# ---- points


def ply(path: Path, header: str, body: bytes = b"") -> Path:
    path.write_bytes(f"ply\nformat binary_little_endian 1.0\n{header}end_header\n".encode() + body)
    return path


XYZ = "property float x\nproperty float y\nproperty float z\n"


def test_points_of_a_ply(tmp_path):
    xyz = np.random.default_rng(0).random((50, 3)).astype("<f4")
    xyz[7] = np.nan
    rgb = np.random.default_rng(1).integers(0, 255, (50, 3)).astype(np.uint8)
    rows = np.zeros(50, [("x", "<f4", 3), ("rgb", "u1", 3)])
    rows["x"], rows["rgb"] = xyz, rgb
    colours = "property uchar red\nproperty uchar green\nproperty uchar blue\n"
    points = read_ply(ply(tmp_path / "a.ply", f"element vertex 50\n{XYZ}{colours}", rows.tobytes()))
    kept = np.arange(50) != 7
    np.testing.assert_array_equal(points.xyz, xyz[kept].astype(np.float64))
    np.testing.assert_array_equal(points.rgb, rgb[kept])
    points = read_ply(ply(tmp_path / "a.ply", f"element vertex 50\n{XYZ}", xyz.tobytes()))
    assert (points.rgb == 128).all() and len(points) == 49


@pytest.mark.parametrize(
    ("header", "told"),
    [
        (f"element vertex {10**12}\n{XYZ}", "cut short"),
        (f"element vertex {2**62}\n{XYZ}", "element vertex 4611686018427387904"),
        (f"element vertex 0\n{XYZ}", "no finite points"),
        ("element face 0\nproperty list uchar int vertex_indices\n", "no vertices with x, y and z"),
        ("element vertex 1\nproperty float x\n", "cut short"),
        ("comment " + "a" * 2_000_000 + "\n", "no end"),
        ("element vertex -1\n", "header"),
        ("", "no vertices"),
    ],
)
def test_points_that_are_announced_and_not_there(tmp_path, header, told):
    path = ply(tmp_path / "a.ply", header)
    with bounded(16 * MIB, 1.0):
        assert told in refused(read_ply, path)


def test_points_that_are_all_nan_or_no_ply(tmp_path):
    path = ply(tmp_path / "a.ply", f"element vertex 3\n{XYZ}", np.full(9, np.nan, "<f4").tobytes())
    assert "no finite points" in refused(read_ply, path)
    assert "is missing; give points.file the path of a .ply" in refused(read_ply, tmp_path / "gone.ply")
    os.mkfifo(tmp_path / "pipe.ply")
    assert "is a pipe" in refused(read_ply, tmp_path / "pipe.ply")
