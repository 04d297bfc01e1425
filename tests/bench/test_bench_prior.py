"""`room2dgs bench prior` from photos on disk to its report."""

from __future__ import annotations

import json
import re
from pathlib import Path

import cv2
import numpy as np
import onnx
import pytest
import trimesh

from room2dgs import cli
from room2dgs.eval.surface import Surface
from room2dgs.mesh.io import read_mesh

WIDTH, HEIGHT, FOCAL = 96, 72, 70.0
ERROR_STEP = 0.002  # of ln depth, one grey level of the photos' blue
FRAMES = 5


def views(make) -> list:
    found = []
    for index in range(FRAMES):
        forward = np.array([np.cos(0.3 * index), np.sin(0.3 * index), -0.35])
        camera = make.camera_at((-0.6 + 0.1 * index, -0.2, 0.1), forward / np.linalg.norm(forward))
        K = np.array([[FOCAL, 0, WIDTH / 2], [0, FOCAL, HEIGHT / 2], [0, 0, 1]])
        found.append(type(camera)(K, WIDTH, HEIGHT, camera.cam_from_world))
    return found


def capture(folder: Path, make, mesh: bool = True) -> Path:
    """A capture of an empty room, whose photos hide a depth prior with smooth errors and what it expects of them.

    Red and green are its millimetres (high and low byte); blue is |ln depth / truth| in steps of `ERROR_STEP`.
    """
    for name in ("color", "depth", "pose", "intrinsic"):
        (folder / name).mkdir(parents=True)
    room = make.room()
    room.export(folder / "gt_mesh.ply")
    surface = Surface(read_mesh(folder / "gt_mesh.ply"))
    K = np.array([[FOCAL, 0, WIDTH / 2 - 0.5, 0], [0, FOCAL, HEIGHT / 2 - 0.5, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    np.savetxt(folder / "intrinsic/intrinsic_color.txt", K)
    x, y = np.meshgrid(np.linspace(0, 1, WIDTH), np.linspace(0, 1, HEIGHT))
    for index, camera in enumerate(views(make)):
        np.savetxt(folder / f"pose/{index}.txt", camera.world_from_cam)
        depth = surface.seen_by(camera).t.reshape(HEIGHT, WIDTH)
        cv2.imwrite(str(folder / f"depth/{index}.png"), np.round(1000 * depth).astype(np.uint16))
        # half of the pixels off to either side, so that no scale takes it out
        error = 0.2 * x * np.sign(np.sin(30 * y))
        millimetres = np.round(1000 * depth * np.exp(error)).astype(np.int64)
        photo = np.stack([millimetres // 256, millimetres % 256, np.round(np.abs(error) / ERROR_STEP)], axis=-1)
        cv2.imwrite(str(folder / f"color/{index}.png"), photo[..., ::-1].astype(np.uint8))
    if not mesh:
        (folder / "gt_mesh.ply").unlink()
    return folder


@pytest.fixture
def network(tmp_path: Path) -> Path:
    """Decodes such photos: outputs "depth" in metres and "depth_error"."""
    weights = {
        "to_depth": np.array([[0.256, 0.001, 0], [0, 0, ERROR_STEP]], np.float32).reshape(2, 3, 1, 1),
        "sides": np.array([1, 1], np.int64),
    }
    nodes = [
        onnx.helper.make_node("Conv", ["image", "to_depth"], ["both"]),
        onnx.helper.make_node("Split", ["both", "sides"], ["depth", "depth_error"], axis=1),
    ]
    tensor = onnx.helper.make_tensor_value_info
    graph = onnx.helper.make_graph(
        nodes,
        "test",
        [tensor("image", onnx.TensorProto.FLOAT, (1, 3, HEIGHT, WIDTH))],
        [tensor(name, onnx.TensorProto.FLOAT, (1, 1, HEIGHT, WIDTH)) for name in ("depth", "depth_error")],
        [onnx.numpy_helper.from_array(value, name) for name, value in weights.items()],
    )
    model = onnx.helper.make_model(graph, opset_imports=[onnx.helper.make_opsetid("", 17)], ir_version=8)
    onnx.save(model, str(tmp_path / "net.onnx"))
    return tmp_path / "net.onnx"


def settings(network: Path) -> list[str]:
    depth = {"output": "depth", "error": "depth_error", "meaning": "metric_depth"}
    network.with_suffix(".json").write_text(json.dumps({"card": 1, "input": {"white": 255}, "depth": depth}))
    return [
        "prior/depth=onnx",
        "prior/normal=none",
        f"prior.depth.model={network}",
    ]


def bench(*argv: object) -> int:
    return cli.main(["bench", "prior", *map(str, argv)])


def refused(capsys, *argv: object) -> str:
    capsys.readouterr()
    assert bench(*argv) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    return said


def test_a_network_with_known_errors(tmp_path, make, network, capsys):
    room, out = capture(tmp_path / "room", make), tmp_path / "out"
    assert bench(room, f"out={out}", *settings(network)) == 0
    saved = json.loads((out / "bench_prior.json").read_text())
    (scene,) = saved["scenes"]
    assert (scene["scene"], scene["frames"], scene["truth"]) == ("room", FRAMES, "mesh")
    assert scene["depth_share"] == 1.0
    # errors even over 0 .. 0.2: a mean of 0.1, which a scale cannot take out
    assert scene["depth"]["metric"]["abs_rel"] == pytest.approx(0.1, abs=0.01)
    assert scene["depth"]["scale"]["abs_rel"] == pytest.approx(0.1, abs=0.01)
    assert scene["depth"]["metric"]["delta1"] == 1.0
    found = scene["depth_ranking"]
    assert found["all"] == pytest.approx(0.1, abs=0.01)
    assert found["confident_half"] == pytest.approx(0.05, abs=0.01)
    assert found["expected"] == pytest.approx(found["all"], abs=0.005)
    assert found["ause"] < 0.1 * found["ause_random"]
    assert scene["normal_ranking"] is None and scene["normals_from"] == "depth"
    assert scene["milliseconds"]["depth"]["median"] > 0
    assert {"processor", "cores"} <= set(saved["machine"]) and saved["command"].startswith("room2dgs bench prior")
    page = (out / "bench_prior.html").read_text(encoding="utf-8")
    assert not re.search(r"https?:|<script", page)
    assert page.count("<img") == 1 + 4 * 8  # the confidence's curves, eight pictures each of four frames
    printed = capsys.readouterr().out
    assert "AbsRel, metric" in printed and "Confidence, depth" in printed and "Confidence, normal" not in printed
    assert "| room | 5 |" in (out / "bench_prior.md").read_text(encoding="utf-8")


def test_exact_maps_from_files_have_no_error_and_are_told_to_be_simulated(tmp_path, make, capsys):
    room = capture(tmp_path / "room", make)
    (tmp_path / "maps/normal").mkdir(parents=True)
    for index, camera in enumerate(views(make)):
        surface = Surface(read_mesh(room / "gt_mesh.ply"))
        normal = surface.face_normals[surface.seen_by(camera).triangle] @ camera.cam_from_world[:3, :3].T
        outside = normal * np.sign((normal * camera_rays(camera)).sum(axis=-1, keepdims=True))
        # in OpenGL's axes, pointing away: what the settings say is to be heeded
        np.save(tmp_path / f"maps/normal/{index}.npy", (outside * [1, -1, -1]).reshape(HEIGHT, WIDTH, 3))
    (tmp_path / "maps/priors.json").write_text('{"simulated": true}')
    out = tmp_path / "out"
    axes = ["prior.normal.encoding=npy", "prior.normal.axes=opengl", "prior.normal.facing=away"]
    files = [
        "prior=files",
        f"prior.depth.path={room / 'depth'}",
        f"prior.normal.path={tmp_path / 'maps/normal'}",
        *axes,
    ]
    assert bench(room, f"out={out}", "scene.frames=3", *files) == 0
    (scene,) = json.loads((out / "bench_prior.json").read_text())["scenes"]
    assert scene["frames"] == 3 and scene["milliseconds"] == {}
    assert scene["depth"]["metric"] == {"abs_rel": 0.0, "delta1": 1.0}
    assert scene["normals"]["mean_deg"] < 0.1 and scene["normals_from"] == "prior"
    assert scene["constant_deg"] > 20 and scene["facing_deg"] >= scene["constant_deg"] - 0.1
    assert "simulated" in capsys.readouterr().out
    assert all("simulated" in (out / f"bench_prior.{suffix}").read_text("utf-8") for suffix in ("md", "html"))


def camera_rays(camera) -> np.ndarray:
    x, y = np.meshgrid(np.arange(WIDTH) + 0.5 - WIDTH / 2, np.arange(HEIGHT) + 0.5 - HEIGHT / 2)
    return np.stack([x / FOCAL, y / FOCAL, np.ones_like(x)], axis=-1).reshape(-1, 3)


def test_frames_without_a_map_are_counted(tmp_path, make):
    room, out = capture(tmp_path / "room", make), tmp_path / "out"
    (tmp_path / "maps").mkdir()
    for index in (0, 2):
        (tmp_path / f"maps/{index}.png").write_bytes((room / f"depth/{index}.png").read_bytes())
    assert (
        bench(room, f"out={out}", "prior/depth=files", "prior/normal=none", f"prior.depth.path={tmp_path / 'maps'}")
        == 0
    )
    (scene,) = json.loads((out / "bench_prior.json").read_text())["scenes"]
    assert (scene["frames"], scene["missing"]) == (2, FRAMES - 2)


@pytest.fixture
def small_maps(tmp_path: Path, make) -> list:
    """Settings of a run on the capture `tmp_path / "room"`, whose depth maps are too small and know the left half."""
    room, maps = capture(tmp_path / "room", make), tmp_path / "maps"
    maps.mkdir()
    for index in range(FRAMES):
        depth = cv2.imread(str(room / f"depth/{index}.png"), cv2.IMREAD_UNCHANGED) / 1000
        depth[:, WIDTH // 2 :] = 0
        np.save(maps / f"{index}.npy", (0.7 * depth).astype(np.float32))
    points, _ = trimesh.sample.sample_surface(trimesh.load_mesh(room / "gt_mesh.ply"), 3000, seed=0)
    trimesh.PointCloud(points).export(tmp_path / "points.ply")
    settings = ["prior/depth=files", "prior/normal=none", f"prior.depth.path={maps}"]
    return [room, *settings, "points.source=file", f"points.file={tmp_path / 'points.ply'}"]


def test_depth_as_a_run_has_it_is_measured_without_a_fit_to_the_truth(tmp_path, small_maps, capsys):
    out = tmp_path / "out"
    assert bench(*small_maps, f"out={out}", "in_run=true") == 0
    (scene,) = json.loads((out / "bench_prior.json").read_text())["scenes"]
    assert scene["depth"]["metric"]["abs_rel"] == pytest.approx(0.3, abs=0.001)
    for step in ("aligned", "optimised"):
        assert scene["in_run"][step]["abs_rel"] < 0.02
        assert scene["in_run"][step]["delta1"] > 0.99
        assert scene["in_run"][step]["within_5cm"] > 0.95
        assert scene["in_run"][step]["share"] == pytest.approx(0.5, abs=0.02)
    assert "Depth in a run" in capsys.readouterr().out


def test_bent_depth_is_what_the_bending_made(tmp_path, small_maps):
    for path in (tmp_path / "maps").glob("*.npy"):
        np.save(path, np.load(path) * np.exp(0.4 * np.arange(WIDTH, dtype=np.float32) / WIDTH))
    out = tmp_path / "out"
    assert bench(*small_maps, f"out={out}", "in_run=true") == 0
    found = json.loads((out / "bench_prior.json").read_text())["scenes"][0]["in_run"]
    # a scale and a shift cannot remove what the joint optimisation does
    assert found["optimised"]["abs_rel"] < 0.5 * found["aligned"]["abs_rel"]


def test_depth_that_is_aligned_alone_is_scored_as_it_is(tmp_path, small_maps):
    out = tmp_path / "out"
    kept = ["prior.depth.align=false", "prior.depth.joint=false"]
    assert bench(*small_maps, f"out={out}", "in_run=true", "scene.frames=3", *kept) == 0
    (scene,) = json.loads((out / "bench_prior.json").read_text())["scenes"]
    assert set(scene["in_run"]) == {"aligned"}
    assert scene["in_run"]["aligned"]["abs_rel"] == pytest.approx(0.3, abs=0.001)
    assert scene["in_run"]["aligned"]["within_5cm"] < 0.05
    assert bench(*small_maps, f"out={out}", "scene.frames=3") == 0
    assert json.loads((out / "bench_prior.json").read_text())["scenes"][0]["in_run"] == {}


def test_rooms_made_for_training_are_measured_too(tmp_path, make, network):
    surface = Surface(make.room())
    shard = tmp_path / "made/shard_00000"
    shard.mkdir(parents=True)
    camera = views(make)[0]
    depth = surface.seen_by(camera).t.reshape(HEIGHT, WIDTH)
    normal = np.zeros((HEIGHT, WIDTH, 3))
    normal[..., 2] = -1
    # stored with a gamma: 255 ((255 / 4) / 255)^(1 / 2.2) of a photo that is white
    np.save(shard / "radiance.npy", np.full((2, HEIGHT, WIDTH, 3), round(255 / 4 ** (1 / 2.2)), np.uint8))
    np.save(shard / "depth.npy", np.stack([depth, depth]).astype(np.float16))
    np.save(shard / "normal.npy", np.round(127 * np.stack([normal, normal])).astype(np.int8))
    np.save(shard / "focal.npy", np.full(2, FOCAL, np.float32))
    out = tmp_path / "out"
    assert bench(tmp_path / "made", f"out={out}", *settings(network)) == 0
    (scene,) = json.loads((out / "bench_prior.json").read_text())["scenes"]
    assert (scene["scene"], scene["frames"], scene["truth"]) == ("made", 2, "exact")
    white = 0.257 * 255  # metres that the network reads in white
    expected = np.abs(white / depth.astype(np.float16).astype(float) - 1).mean()
    assert scene["depth"]["metric"]["abs_rel"] == pytest.approx(expected, rel=0.01)
    assert scene["constant_deg"] == pytest.approx(0.0, abs=0.1)


def test_bad_input_is_told_in_a_sentence(tmp_path, make, network, capsys):
    room = capture(tmp_path / "room", make)
    none = ["prior/depth=none", "prior/normal=none"]
    assert "no prior is configured" in refused(capsys, room, *none)
    for source in ("sensor", "auto"):
        said = refused(capsys, room, f"prior/depth={source}", "prior/normal=none")
        assert f"prior.depth.source={source} would be measured against itself" in said
    assert "no scene is given" in refused(capsys, *none)
    assert "nowhere is not there" in refused(capsys, tmp_path / "nowhere", *none)
    assert "settings are written KEY=VALUE" in refused(capsys, "--fast", room)
    assert "did you mean scene.frames" in refused(capsys, room, "scene.frame=3")
    (tmp_path / "taken").write_text("dear")
    assert "is a file" in refused(capsys, room, f"out={tmp_path / 'taken'}", *settings(network))
    for file in (room / "depth").iterdir():
        file.unlink()
    assert "has no depth maps" in refused(capsys, room, *settings(network))
    assert "choose from raster, prior, lengths" in _said(capsys, ["bench", "speed"])


def _said(capsys, argv: list[str]) -> str:
    capsys.readouterr()
    assert cli.main(argv) == 2
    return capsys.readouterr().err


def test_help_names_the_settings(capsys):
    assert bench("--help") == 0
    said = capsys.readouterr().out
    assert "room2dgs bench prior SCENE..." in said and "prior.depth.model" in said and "train.iterations" not in said
