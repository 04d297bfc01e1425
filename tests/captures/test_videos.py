"""Videos of strangers: which files FFmpeg gets to see, and frames asked for in any order by several threads."""

from __future__ import annotations

import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Barrier
from time import sleep

import cv2
import numpy as np
import pytest

from room2dgs.captures import video as module
from room2dgs.captures.video import Video, is_container, open_video
from room2dgs.errors import InputError

FRAMES = 90


@pytest.fixture(scope="module")
def walk(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("video") / "walk.mp4"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"mp4v"), 30, (64, 48))
    noise = cv2.resize(np.random.default_rng(0).integers(0, 255, (12, 16, 3), np.uint8), (64, 48))
    for index in range(FRAMES):
        writer.write(np.roll(noise, index, axis=1))
    writer.release()
    return path


@pytest.fixture(scope="module")
def frames(walk) -> list[np.ndarray]:
    """As OpenCV gives them one after another."""
    capture, found = cv2.VideoCapture(str(walk)), []
    while True:
        good, image = capture.read()
        if not good:
            return found
        found.append(cv2.cvtColor(image, cv2.COLOR_BGR2RGB))


@pytest.fixture
def opened(monkeypatch) -> list[Path]:
    """Paths of the videos, one each time that decoding begins anew."""
    paths = []

    def counted(path, upright):
        paths.append(path)
        return open_video(path, upright)

    monkeypatch.setattr(module, "open_video", counted)
    return paths


@pytest.mark.parametrize(
    "content",
    [
        b"#EXTM3U\n#EXT-X-TARGETDURATION:10\n#EXTINF:10,\nfile:///etc/passwd\n",
        b"ffconcat version 1.0\nfile '/etc/passwd'\n",
        b"v=0\no=- 0 0 IN IP4 127.0.0.1\nc=IN IP4 127.0.0.1\nm=video 5004 RTP/AVP 96\n",
        b"<?xml version='1.0'?><MPD></MPD>\n",
        b"just a text\n",
        b"\x89PNG\r\n\x1a\n" + bytes(600),
    ],
)
def test_what_is_no_container_is_refused_before_a_decoder_sees_it(tmp_path, monkeypatch, content):
    monkeypatch.setattr(cv2, "VideoCapture", lambda *_: pytest.fail("a decoder was started"))
    path = tmp_path / "walk.mp4"
    path.write_bytes(content)
    for read in (lambda: Video(path).size(), lambda: open_video(path, True)):
        with pytest.raises(InputError, match=r"walk\.mp4 cannot be read as a video: it is none of .* \(it begins "):
            read()


def test_files_that_are_not_there_or_no_files(tmp_path, walk):
    with pytest.raises(InputError, match="is missing"):
        Video(tmp_path / "gone.mp4").frame(0)
    os.mkfifo(tmp_path / "pipe.mp4")
    with pytest.raises(InputError, match="is a pipe where a file belongs"):
        Video(tmp_path / "pipe.mp4").frame(0)
    (tmp_path / "empty.mp4").touch()
    with pytest.raises(InputError, match="is empty"):
        len(Video(tmp_path / "empty.mp4"))
    (tmp_path / "cut.mp4").write_bytes(walk.read_bytes()[:300])
    with pytest.raises(InputError, match="cannot be read as a video: it is damaged"):
        Video(tmp_path / "cut.mp4").frame(0)


def test_of_a_damaged_video_libraries_say_nothing_besides(tmp_path):
    (tmp_path / "a.mp4").write_bytes(b"\0\0\0\x18ftypmp42" + bytes(40))
    argv = ["prepare", f"video={tmp_path / 'a.mp4'}", f"out={tmp_path / 'out'}"]
    # FFmpeg asks once in a process how much it may say
    done = subprocess.run([sys.executable, "-m", "room2dgs.cli", *argv], capture_output=True, text=True, check=False)
    assert done.returncode == 2 and done.stderr.count("\n") == 1
    assert done.stderr.startswith("room2dgs: ") and "it is damaged or of a codec" in done.stderr


def test_names_that_are_patterns_or_addresses_are_names(tmp_path, walk, frames, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("walk_%02d.mp4", "concat:a|b.mp4", "-i.mp4", "file:x.mp4", "walk\n.mp4", "${out}.mp4"):
        Path(name).write_bytes(walk.read_bytes())
        np.testing.assert_array_equal(Video(Path(name)).frame(3), frames[3])


@pytest.mark.parametrize("suffix", [("avi", "MJPG"), ("mkv", "mp4v"), ("mov", "mp4v"), ("mp4", "mp4v")])
def test_containers_are_known_by_their_first_bytes(tmp_path, suffix):
    path = tmp_path / f"walk.{suffix[0]}"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*suffix[1]), 30, (64, 48))
    for level in range(5):
        writer.write(np.full((48, 64, 3), 40 * level, np.uint8))
    writer.release()
    assert is_container(path.read_bytes()[:512])
    path.rename(tmp_path / "other.bin")
    assert Video(tmp_path / "other.bin").size() == (64, 48)


@pytest.mark.parametrize("threads", [1, 4, 24])
def test_threads_together_decode_a_video_once(walk, frames, opened, threads):
    """Half of the frames, asked for by a pool: whoever is ahead keeps what the others wait for."""
    video, numbers = Video(walk), range(0, FRAMES, 2)
    with ThreadPoolExecutor(threads) as pool:
        found = list(pool.map(video.frame, numbers))
    for number, image in zip(numbers, found, strict=True):
        np.testing.assert_array_equal(image, frames[number])
    assert len(opened) == 1


def test_frames_that_threads_wait_for_are_kept_on_the_way(walk, frames, opened, monkeypatch):
    """With no memory for what was passed, too."""
    monkeypatch.setattr(module, "KEPT_BYTES", 1)
    video, together = Video(walk), Barrier(8)
    order = [70, 10, 60, 20, 50, 30, 40, 0]

    def ask(number: int) -> np.ndarray:
        together.wait()
        return video.frame(number)

    with ThreadPoolExecutor(8) as pool:
        with video._alone():
            asked = [pool.submit(ask, number) for number in order]
            while len(video._wanted) < 8:
                sleep(0.001)
        found = [one.result() for one in asked]
    for number, image in zip(order, found, strict=True):
        np.testing.assert_array_equal(image, frames[number])
    assert len(opened) == 1
    assert not video._wanted and not video._found and len(video._kept) <= 1


def test_steps_back_decode_few_frames_anew(walk, frames, opened):
    video = Video(walk)
    for number in range(FRAMES - 1, -1, -1):
        np.testing.assert_array_equal(video.frame(number), frames[number])
    assert len(opened) <= 2


def test_memory_of_frames_is_bounded(walk, monkeypatch):
    room = 5 * 64 * 48 * 3
    monkeypatch.setattr(module, "KEPT_BYTES", room)
    video = Video(walk)
    for number in (*range(0, FRAMES, 3), *range(FRAMES - 1, 0, -7)):
        video.frame(number)
        assert sum(image.nbytes for image in video._kept.values()) <= room and not video._found


def test_a_frame_beyond_the_end_is_looked_for_once(walk, opened):
    video = Video(walk)
    for number in (FRAMES, FRAMES + 5, 10**7):
        with pytest.raises(InputError, match=f"ends before frame {number}"):
            video.frame(number)
    assert len(opened) == 1 and video.frame(FRAMES - 1) is not None
