"""A video of a known corner becomes a capture; what cannot become one is refused by a sentence."""

from __future__ import annotations

import hashlib
import json
import re
import shutil
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from room2dgs import cli
from room2dgs.captures.read import placed
from room2dgs.colmap import pycolmap
from room2dgs.config import load_config
from room2dgs.eval.alignment import by_cameras, transformed
from room2dgs.prepare import bridge
from room2dgs.prepare.bridge import Common, bridged, common_points
from room2dgs.prepare.contradictions import contradictions
from room2dgs.prepare.features import _rename, matched
from room2dgs.prepare.merge import merged
from room2dgs.prepare.verdict import doubts

QUICK = ["prepare.features=700", "prepare.length=[height,1.3]"]
VIEWS = 12


def write_video(path: Path, pictures: list[np.ndarray]) -> Path:
    height, width = pictures[0].shape[:2]
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), 5, (width, height))
    for picture in pictures:
        writer.write(cv2.cvtColor(picture, cv2.COLOR_RGB2BGR))
    writer.release()
    return path


@pytest.fixture(scope="module")
def walk(corner_walk) -> list[tuple[np.ndarray, np.ndarray]]:
    """(world_from_cam, photo) around the corner."""
    angles = np.radians(np.linspace(15.0, 70.0, VIEWS))
    eyes = [[(2.2 + 0.2 * np.sin(9 * a)) * np.cos(a), (2.2 + 0.2 * np.sin(9 * a)) * np.sin(a), 1.3] for a in angles]
    return corner_walk(eyes, [[0.2, 0.2, 0.4]] * VIEWS)


@pytest.fixture(scope="module")
def prepared(walk, tmp_path_factory) -> tuple[Path, Path]:
    """The video and the capture that was made of it, on one thread."""
    folder = tmp_path_factory.mktemp("prepared")
    video = write_video(folder / "walk.avi", [photo for _, photo in walk])
    assert cli.main(["prepare", f"video={video}", f"out={folder / 'room'}", "prepare.threads=1", *QUICK]) == 0
    return video, folder / "room"


def scene_of(folder: Path):
    return placed(load_config([f"scene.path={folder}", "out=unused", "scene.test_every=0"]).scene)


def bits(folder: Path) -> list[str]:
    return [hashlib.sha256(path.read_bytes()).hexdigest() for path in sorted((folder / "sparse/0").iterdir())]


@pytest.mark.slow
def test_a_video_becomes_a_capture_that_lies_where_it_was_filmed(prepared, walk):
    verdict = json.loads((prepared[1] / "prepare.json").read_text())
    assert verdict["placed"] == VIEWS and not verdict["left_out"] and not verdict["film_again"]
    assert verdict["reprojection_px"] < 0.5 and verdict["scale"]["source"] == "length"
    scene = scene_of(prepared[1])
    assert scene.metric and "prepare.json" in " ".join(scene.notes)
    found = by_cameras(
        {frame.name: frame.camera.centre for frame in scene.frames},
        {f"view_{index}": pose[:3, 3] for index, (pose, _) in enumerate(walk)},
        with_scale=True,
    )
    assert found.pairs == VIEWS and found.rms_m < 0.01
    assert found.scale == pytest.approx(1.0, abs=0.03)  # by the height, not by the truth
    up = found.truth_from_pred[:3, 2] / found.scale
    assert np.degrees(np.arccos(up[2])) < 2.0
    points = scene.given_points()
    assert points.tracks is not None and len(points) > 300
    off = np.abs(transformed(points.xyz, found.truth_from_pred)).min(axis=1)  # from the corner's nearest plane
    assert np.median(off) < 0.01
    assert cv2.imread(str(prepared[1] / "camera_path.png")).std() > 5


@pytest.mark.slow
def test_a_killed_preparation_goes_on_to_the_same_bits_with_any_threads(prepared, tmp_path, capsys):
    video, whole = prepared
    out = tmp_path / "again"
    shutil.copytree(whole, out)
    for name in ("model.json", "room.json", "pairs.json", "scale.json"):
        (out / "work" / name).unlink(missing_ok=True)
    for name in ("prepare.json", "sparse", "work/model"):
        path = out / name
        shutil.rmtree(path) if path.is_dir() else path.unlink()
    with pycolmap.Database.open(out / "work/database.db") as database:  # killed among the features and the matches
        database.clear_matches()
        database.clear_two_view_geometries()
    assert cli.main(["prepare", f"video={video}", f"out={out}", "prepare.threads=2", *QUICK]) == 0
    assert bits(out) == bits(whole)
    assert "features: " not in capsys.readouterr().out.replace("features, ", "")
    assert cli.main(["prepare", f"video={video}", f"out={out}", *QUICK[:1], "prepare.length=[height,2.6]"]) == 0
    assert "features, matches and model are there from before" in capsys.readouterr().out
    one, other = (scene_of(folder).frames for folder in (whole, out))
    assert np.linalg.norm(other[0].camera.centre - other[-1].camera.centre) == pytest.approx(
        2 * np.linalg.norm(one[0].camera.centre - one[-1].camera.centre)
    )


@pytest.mark.slow
@pytest.mark.parametrize("kept", [(slice(0, 8), slice(4, 12)), (slice(0, 6), slice(6, 12))], ids=["photos", "matches"])
def test_two_models_that_share_photos_or_matches_become_one(prepared, tmp_path, kept):
    whole = pycolmap.Reconstruction(prepared[1] / "work/model")
    ids = sorted(whole.reg_image_ids())

    def part(kept: list[int]) -> pycolmap.Reconstruction:
        model = pycolmap.Reconstruction(whole)
        for image_id in ids:
            if image_id not in kept:
                model.deregister_frame(model.image(image_id).frame_id)
        return model

    first, second = part(ids[kept[0]]), part(ids[kept[1]])
    turned = np.array([[0, -1.0, 0], [1, 0, 0], [0, 0, 1]])
    second.transform(pycolmap.Sim3d(np.c_[3.0 * turned, [5.0, -2, 1]]))
    database, images = prepared[1] / "work/database.db", prepared[1] / "images"
    said: list[str] = []
    model, left = merged([first, second], database, images, tmp_path, False, said.append)
    assert not left and model.num_reg_images() == len(ids)
    assert f"{len(ids) - first.num_reg_images()} photos join the larger one" in said[0]
    centre = {i: whole.image(i).projection_center() for i in ids}
    found = by_cameras(
        {str(i): model.image(i).projection_center() for i in ids}, {str(i): centre[i] for i in ids}, with_scale=True
    )
    reach = np.linalg.norm(centre[ids[0]] - centre[ids[-1]])
    assert found.rms_m < 0.01 * reach
    if second.num_reg_images() == 6:  # without a match across nothing says where they lie
        silent = tmp_path / "silent.db"
        shutil.copy(database, silent)
        with pycolmap.Database.open(silent) as opened:
            opened.clear_two_view_geometries()
        assert merged([first, second], silent, images, tmp_path, False, said.append)[1] == [second]


@pytest.mark.slow
def test_matches_that_agree_on_no_place_join_nothing(prepared, monkeypatch):
    """A model is bridged to itself; not where the points of its matches are mixed up, nor by a few of them."""
    whole = pycolmap.Reconstruction(prepared[1] / "work/model")
    common = common_points(whole, whole, prepared[1] / "work/database.db")
    assert bridged(whole, whole, prepared[1] / "work/database.db") is not None
    random = np.random.default_rng(0)
    wrong = common._replace(other=random.permutation(common.other))
    monkeypatch.setattr(bridge, "common_points", lambda *args: wrong)
    assert bridged(whole, whole, prepared[1] / "work/database.db") is None
    monkeypatch.setattr(bridge, "common_points", lambda *args: Common(*(column[:15] for column in common)))
    assert bridged(whole, whole, prepared[1] / "work/database.db") is None


@pytest.mark.slow
def test_a_model_that_was_put_together_wrongly_is_doubted(prepared, tmp_path):
    database = prepared[1] / "work/database.db"
    model = pycolmap.Reconstruction(prepared[1] / "work/model")
    right = contradictions(model, database)
    assert right.share < 0.05 and doubts(right._asdict()) == []
    for image_id in sorted(model.reg_image_ids())[7:]:  # the rest of the walk, twice as long and turned by 9 degrees
        pose = model.image(image_id).cam_from_world()
        turned = cv2.Rodrigues(np.array([0.0, 0.15, 0.0]))[0] @ pose.rotation.matrix()
        model.frame(model.image(image_id).frame_id).rig_from_world = pycolmap.Rigid3d(
            np.c_[turned, 2 * pose.translation]
        )
    wrong = contradictions(model, database)
    assert wrong.share > 0.2 and len(wrong.pairs) == 3
    (said,) = doubts(wrong._asdict())
    assert "contradict the poses" in said and wrong.pairs[0][0] in said
    for name in ("images", "sparse"):
        shutil.copytree(prepared[1] / name, tmp_path / name)
    verdict = json.loads((prepared[1] / "prepare.json").read_text())
    assert verdict["warnings"] == []
    (tmp_path / "prepare.json").write_text(json.dumps({**verdict, "warnings": [said, 7]}))
    assert scene_of(tmp_path).warnings == (said,)


@pytest.mark.slow
def test_photos_that_show_something_else_are_left_out_by_name(walk, tmp_path, capsys):
    source = tmp_path / "photos"
    source.mkdir()
    for index, (_, photo) in enumerate(walk[:8]):
        cv2.imwrite(str(source / f"room {index}.png"), photo[..., ::-1])
    for seed, name in enumerate(("cat.png", "zoo.png")):
        cv2.imwrite(str(source / name), cv2.GaussianBlur(noise(seed, walk[0][1].shape[:2]), (0, 0), 1))
    out = tmp_path / "out"
    assert cli.main(["prepare", f"images={source}", f"out={out}", *QUICK]) == 0
    assert "left out: cat.png, zoo.png" in capsys.readouterr().out
    verdict = json.loads((out / "prepare.json").read_text())
    assert verdict["left_out"] == ["cat.png", "zoo.png"] and verdict["placed"] == 8
    assert sorted(frame.name for frame in scene_of(out).frames) == [f"room {index}" for index in range(8)]
    database, names = out / "work/database.db", ["cat.png", *(f"room {index}.png" for index in range(8)), "zoo.png"]
    _rename(database, [f"photo-{index}" for index in range(10)])  # as a kill amid matching leaves them
    config = load_config([f"scene.path={source}", "out=unused"]).prepare
    matched(
        database,
        [SimpleNamespace(name=name, size=(160, 120)) for name in names],
        [],
        tmp_path,
        config,
        lambda line: None,
    )
    with pycolmap.Database.open(database) as opened:
        assert [image.name for image in opened.read_all_images()] == names


def test_a_camera_that_only_turns_is_named_and_its_photos_are_matched_on_one_thread(
    corner_walk, tmp_path, capsys, monkeypatch
):
    match, threads = pycolmap.match_image_pairs, set()

    def watched(path, options, *given, **named):
        threads.add(options.num_threads)
        match(path, options, *given, **named)

    monkeypatch.setattr(pycolmap, "match_image_pairs", watched)
    eyes = [[1.6, 1.5, 1.3]] * 8
    photos = corner_walk(eyes, [[1.2 * a - 0.2, 0.9 - 1.2 * a, 0.4] for a in np.linspace(0, 0.9, 8)])
    video = write_video(tmp_path / "turn.avi", [photo for _, photo in photos])
    assert cli.main(["prepare", f"video={video}", f"out={tmp_path / 'out'}", "prepare.features=400"]) == 2
    assert "taken from one place" in capsys.readouterr().err
    assert threads == {1}  # on more, pycolmap's matching races


def noise(seed: int, size=(120, 160)) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 256, (*size, 3)).astype(np.uint8)


def still(folder: Path) -> str:
    return f"video={write_video(folder / 'v.avi', [cv2.GaussianBlur(noise(0), (0, 0), 2)] * 9)}"


def no_video(folder: Path) -> str:
    (folder / "v.mp4").write_bytes(b"\0\0\0\x20ftypisom" + bytes(4000))
    return f"video={folder / 'v.mp4'}"


def short(folder: Path) -> str:
    return f"video={write_video(folder / 'v.avi', [noise(0), noise(1)])}"


def strangers(folder: Path) -> str:
    for seed in range(6):
        cv2.imwrite(str(folder / f"{seed}.png"), cv2.GaussianBlur(noise(seed), (0, 0), 1))
    return f"images={folder}"


def blurred(folder: Path) -> str:
    for seed in range(6):
        smooth = cv2.GaussianBlur(noise(seed).astype(np.float32), (0, 0), 9)
        grain = np.random.default_rng(seed).normal(0, 1.5, smooth.shape)  # which is as sharp as ever
        cv2.imwrite(str(folder / f"{seed}.png"), (smooth - smooth.min()) * 10 + grain)
    return f"images={folder}"


def sizes(folder: Path) -> str:
    for seed in range(6):
        cv2.imwrite(str(folder / f"{seed}.png"), noise(seed, (120 + 7 * seed, 160)))
    return f"images={folder}"


def damaged(folder: Path) -> str:
    strangers(folder)
    for number in (3, 4, 5):  # more than may be left out
        data = (folder / f"{number}.png").read_bytes()
        (folder / f"{number}.png").write_bytes(data[: len(data) // 2])
    return f"images={folder}"


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (no_video, "cannot be read as a video|no frame that can be decoded"),
        (short, "has 2 frames"),
        (still, "hardly any motion"),
        (strangers, "hardly any two show the same"),
        (blurred, "blurred all over"),
        (sizes, "photos of 6 sizes"),
        (damaged, "3.png cannot be decoded.*3 photos that cannot be read, of 6"),
        (lambda folder: f"images={folder}", "has no photos"),
        (lambda folder: f"video={folder / 'none.mp4'}", "is not there"),
        (lambda folder: "prepare.max_photos=20", "give video=FILE or images=DIR"),
    ],
)
def test_what_cannot_be_used_is_one_sentence_and_leaves_nothing_half_made(make, said, tmp_path, capsys):
    source = tmp_path / "source"
    source.mkdir()
    given = make(source)
    before = sorted(source.iterdir())
    out = tmp_path / "out"
    assert cli.main(["prepare", given, f"out={out}", "prepare.features=300"]) == 2
    error = capsys.readouterr().err
    assert len(error.strip().splitlines()) == 1
    assert re.search(said, error), error
    assert sorted(source.iterdir()) == before
    assert not (out / "prepare.json").exists() and not (out / "sparse").exists()
    if make not in (strangers,):
        assert not (out / "images").exists()


def test_photos_are_copied_upright_with_the_focal_length_of_their_exif(tmp_path):
    from PIL import Image

    from room2dgs.prepare.photos import choose_photos
    from room2dgs.prepare.stage_cache import StageCache

    source = tmp_path / "source"
    source.mkdir()
    for index in range(6):
        picture = noise(index)
        picture[:10] = 255  # the top
        image = Image.fromarray(np.rot90(picture, 1).copy() if index == 2 else picture)
        exif = Image.Exif()
        exif[0x0112] = 6 if index == 2 else 1
        exif.get_ifd(0x8769)[0xA405] = 27
        image.save(source / f"{index}.jpg", quality=95, exif=exif)
    config = load_config([f"prepare.images={source}", "scene.path=unused", "out=unused"]).prepare
    photos, _ = choose_photos(config, tmp_path / "images", StageCache(tmp_path), lambda line: None)
    assert [photo.name for photo in photos] == [f"{index}.jpg" for index in range(6)]
    assert {photo.size for photo in photos} == {(160, 120)}
    assert photos[2].focal_px == pytest.approx(27 / 43.27 * 200, rel=1e-3)
    assert cv2.imread(str(tmp_path / "images/2.jpg"), cv2.IMREAD_IGNORE_ORIENTATION | 1)[:8].mean() > 240
    assert (tmp_path / "images/1.jpg").read_bytes() == (source / "1.jpg").read_bytes()


def test_photos_that_are_no_plain_files_are_turned_upright_too(tmp_path):
    from PIL import Image

    from room2dgs.prepare.photos import _copied

    picture = noise(0)
    picture[:10] = 255  # the top
    layers = np.dstack([np.rot90(picture, 1), np.full((160, 120), 255, np.uint8)])
    exif = Image.Exif()
    exif[0x0112] = 6
    Image.fromarray(layers).save(tmp_path / "a b.png", exif=exif)
    (tmp_path / "out").mkdir()
    name, _ = _copied(tmp_path / "a b.png", tmp_path / "out")
    copy = cv2.imread(str(tmp_path / "out" / name), cv2.IMREAD_UNCHANGED)
    assert copy.shape == (120, 160, 3) and copy[:8].mean() > 240
    assert Image.open(tmp_path / "out" / name).getexif().get(0x0112, 1) == 1


@pytest.mark.parametrize(
    ("shown", "expected"),
    [([0.0, 0.033, 0.1, 0.4], [0.0, 0.033, 0.1, 0.4]), ([0.0, 0.0, 0.0, 0.0], [0.0, 0.1, 0.2, 0.3])],
)
def test_frames_are_shown_when_the_video_says_if_it_says(monkeypatch, shown, expected):
    """Phones film at a varying rate; some files tell no times."""
    from room2dgs.prepare import photos

    class Video:
        def get(self, what):
            return {cv2.CAP_PROP_FRAME_COUNT: len(shown), cv2.CAP_PROP_FPS: 10.0}[what]

        def release(self):
            pass

    frames = [(index, noise(index), seconds) for index, seconds in enumerate(shown)]
    monkeypatch.setattr(photos, "_opened", lambda path: Video())
    monkeypatch.setattr(photos, "_frames", lambda path: iter(frames))
    assert photos._scanned(None, lambda line: None)["seconds"] == expected


@pytest.mark.parametrize(("half", "centre"), [(True, 80.0), (False, 80.5)])
def test_a_known_camera_counts_as_its_intrinsics_are_said_to(tmp_path, half, centre):
    from room2dgs.colmap import pycolmap
    from room2dgs.prepare.features import new_database
    from room2dgs.prepare.photos import ChosenPhoto

    photo = ChosenPhoto("a.jpg", (160, 120), None, None, 0, 1.0)
    config = load_config(["prepare.images=unused", "scene.path=unused", "out=unused"]).prepare
    new_database(tmp_path / "a.db", [photo], config, [140.0, 140.0, 80.0, 60.0], half)
    with pycolmap.Database.open(tmp_path / "a.db") as database:
        assert database.read_all_cameras()[0].params[2] == centre


def test_intrinsics_of_a_larger_video_are_refused_before_anything_is_matched(tmp_path):
    """Its frames were made smaller (`prepare.max_side`)."""
    from room2dgs.errors import InputError
    from room2dgs.prepare.features import new_database
    from room2dgs.prepare.photos import ChosenPhoto

    photo = ChosenPhoto("a.jpg", (160, 120), None, None, 0, 1.0)
    config = load_config(["prepare.images=unused", "scene.path=unused", "out=unused"]).prepare
    with pytest.raises(InputError, match="160x120"):
        new_database(tmp_path / "a.db", [photo], config, [280.0, 280.0, 160.0, 120.0], True)


def test_depth_that_lies_on_its_side_beside_upright_photos_is_refused(tmp_path):
    from room2dgs.errors import InputError
    from room2dgs.prepare.photos import ChosenPhoto
    from room2dgs.prepare.sources import depth_files

    cv2.imwrite(str(tmp_path / "a.png"), np.full((30, 40), 2000, np.uint16))
    assert depth_files(tmp_path, [ChosenPhoto("a.jpg", (160, 120), None, None, 0, 1.0)])
    with pytest.raises(InputError, match="40x30 pixels, but its photo, turned upright, 120x160"):
        depth_files(tmp_path, [ChosenPhoto("a.jpg", (120, 160), None, None, 0, 1.0)])


def test_two_photos_that_would_have_one_name_are_refused(tmp_path):
    from PIL import Image

    from room2dgs.errors import InputError
    from room2dgs.prepare.photos import choose_photos
    from room2dgs.prepare.stage_cache import StageCache

    source = tmp_path / "source"
    source.mkdir()
    for index in range(6):
        Image.fromarray(noise(index)).save(source / f"{index}.jpg", quality=95)
    for suffix in ("tif", "png"):
        Image.fromarray(noise(7)).save(source / f"twice.{suffix}")
    config = load_config([f"prepare.images={source}", "scene.path=unused", "out=unused"]).prepare
    with pytest.raises(InputError, match=r"would both be twice\.png; rename"):
        choose_photos(config, tmp_path / "images", StageCache(tmp_path), lambda line: None)
    assert not (tmp_path / "images").exists()


def test_run_of_a_video_makes_its_capture_in_the_runs_folder(monkeypatch, tmp_path):
    """And goes on with it; a taken folder is refused before hours of matching."""
    from room2dgs.errors import InputError
    from room2dgs.pipeline import reconstruct as command

    made = []
    monkeypatch.setattr(command, "prepare_capture", lambda config, out, show: made.append((config.prepare.video, out)))
    video, out = tmp_path / "a=b.mp4", tmp_path / "run"
    result = command.with_capture([f"prepare.video={video}", f"out={out}"])
    assert made == [(str(video), out / "capture")] and result[-1] == f"scene.path={out / 'capture'}"
    (out / "capture").mkdir(parents=True)
    command.with_capture([f"prepare.video={video}", f"out={out}"])  # killed while it prepared: goes on
    assert command.with_capture(["scene.path=room", f"out={out}"]) == ["scene.path=room", f"out={out}"]
    (out / "notes.txt").write_text("mine")
    with pytest.raises(InputError, match="not empty"):
        command.with_capture([f"prepare.video={video}", f"out={out}"])
    with pytest.raises(InputError, match="poses already"):
        command.with_capture([f"prepare.video={video}", "scene.path=room", f"out={out}"])
    assert len(made) == 2
