"""The correction of depth: its losses, how samples are varied, training, and the exported file."""

from __future__ import annotations

import numpy as np
import onnx
import pytest
import torch

from room2dgs.depth.completion import evidence
from room2dgs.errors import InputError
from room2dgs.tools import export_correction, train_correction
from room2dgs.tools.correction_network.losses import Target, losses
from room2dgs.tools.correction_network.network import Correction, CorrectionNetwork
from room2dgs.tools.correction_network.samples import completed_depth, read_rooms, stacked, varied
from room2dgs.tools.correction_network.training import Options, load, train

HEIGHT, WIDTH = 16, 24


def target(shift: float = 0.1, depth: float = 2.0) -> Target:
    return Target(torch.full((1, HEIGHT, WIDTH), shift), torch.full((1, HEIGHT, WIDTH), depth))


def said(shift: float, ln_scale: float = -3.0) -> Correction:
    return Correction(torch.full((1, HEIGHT, WIDTH), shift), torch.full((1, HEIGHT, WIDTH), ln_scale))


def test_the_truth_has_no_loss_and_half_wrong_is_at_the_stated_distances():
    right = losses(said(0.1), target())
    assert all(float(right[name]) < 1e-12 for name in ("near", "nearer", "depth", "slope"))
    assert float(losses(said(0.1 + 0.025), target())["near"]) == pytest.approx(0.5, abs=1e-6)
    assert float(losses(said(0.1 + 0.01), target())["nearer"]) == pytest.approx(0.5, abs=1e-6)


def test_unknown_pixels_count_for_nothing_not_even_in_the_gradient():
    truth = target()
    truth.shift[:, :4] = torch.nan
    found = said(0.3)
    found.shift[:, :4] = 9.0
    found.shift.requires_grad_(True)
    terms = losses(found, truth)
    known = losses(said(0.3), target())
    assert all(terms[name].item() == pytest.approx(known[name].item(), abs=1e-6) for name in ("near", "depth", "slope"))
    sum(terms.values()).backward()
    assert torch.isfinite(found.shift.grad).all() and not found.shift.grad[:, :4].any()


def test_the_expected_error_that_fits_best_is_the_mean_error():
    scales = torch.linspace(-6, 0, 121)
    costs = [float(losses(said(0.15, float(scale)), target())["likelihood"]) for scale in scales]
    assert float(scales[int(np.argmin(costs))]) == pytest.approx(np.log(0.05), abs=0.05)


def batch(count: int = 64) -> tuple[torch.Tensor, Target]:
    random = torch.Generator().manual_seed(3)
    inputs = torch.rand((count, evidence.CHANNELS, 4, 6), generator=random)
    return inputs, Target(torch.rand((count, 4, 6), generator=random), completed_depth(inputs))


def test_a_mirrored_sample_has_its_normals_rays_and_truth_mirrored():
    inputs, truth = batch()
    seen = set()
    for seed in range(8):
        other, changed = varied(inputs, truth, torch.Generator().manual_seed(seed))
        mirrored = bool((changed.shift == truth.shift.flip(-1)).all())
        seen.add(mirrored)
        sign = -1 if mirrored else 1
        for channel in (evidence.RAYS, evidence.RAYS + 1, evidence.SAMPLE, evidence.NORMAL):
            wanted = inputs[:, channel].flip(-1) if mirrored else inputs[:, channel]
            wanted = sign * wanted if channel in (evidence.RAYS, evidence.NORMAL) else wanted
            kept = other[:, channel] == wanted
            assert kept.flatten(1).all(1).float().mean() > (0.85 if channel == evidence.NORMAL else 0.999)
    assert seen == {True, False}


def test_a_room_of_another_size_has_its_errors_in_metres_of_that_size():
    inputs, truth = batch()
    other, changed = varied(inputs, truth, torch.Generator().manual_seed(0))
    factor = (other[:, evidence.LN_MEDIAN] - inputs[:, evidence.LN_MEDIAN].mean()).exp()
    assert factor.std() > 0.1
    torch.testing.assert_close(changed.depth, completed_depth(other))


@pytest.fixture
def data(tmp_path):
    """Two rooms whose depth is 5 % too small wherever stereo says 5 % more, and right elsewhere."""
    random = np.random.default_rng(0)
    for name in ("room_0000", "room_0001"):
        inputs = np.zeros((6, evidence.CHANNELS, HEIGHT, WIDTH), np.float16)
        off = random.random((6, HEIGHT // 8, WIDTH // 8)) < 0.5
        shift = np.log(1.05) * np.kron(off, np.ones((8, 8)))
        inputs[:, evidence.SAMPLE], inputs[:, evidence.SAMPLE_WEIGHT], inputs[:, evidence.LN_MEDIAN] = shift, 1, 1
        (tmp_path / "data" / name).mkdir(parents=True)
        np.save(tmp_path / "data" / name / "evidence.npy", inputs)
        np.save(tmp_path / "data" / name / "shift.npy", shift.astype(np.float16))
    return tmp_path / "data"


def test_training_learns_what_the_evidence_says_and_says_so_on_held_out_rooms(data, tmp_path):
    rooms, lines = read_rooms(data), []
    weights = train(rooms, rooms, tmp_path / "run", Options(steps=60, batch=2, lr=5e-3), log=lines.append)
    inputs, truth = stacked([(rooms["room_0000"].evidence[0], rooms["room_0000"].shift[0])])
    network = CorrectionNetwork()
    network.load_state_dict(weights)
    with torch.no_grad():
        found = network(inputs)
    assert float((found.shift - truth.shift).abs().mean()) < 0.5 * float(truth.shift.abs().mean())
    assert lines[0] == "12 views of 2 rooms, 2 held out" and "room_0001: within 2/5/10 cm" in lines[-1]
    assert all((load(tmp_path / "run")[name] == value).all() for name, value in weights.items())


def test_the_command_trains_and_the_file_it_exports_gives_the_same_as_torch(data, tmp_path, capsys):
    run, out = tmp_path / "run", tmp_path / "made.onnx"
    given = [str(data), str(run), "--minutes", "0.01", "--held-out", str(data)]
    assert train_correction.main(given) == 0
    assert train_correction.main([*given, "--from", str(run)]) == 0
    assert export_correction.main([str(run), str(out)]) == 0
    assert "MB, at most" in capsys.readouterr().out
    graph = onnx.load(out).graph
    shapes = {
        value.name: [axis.dim_param or axis.dim_value for axis in value.type.tensor_type.shape.dim]
        for value in (*graph.input, *graph.output)
    }
    assert shapes["evidence"] == [1, evidence.CHANNELS, "height", "width"] and list(shapes) == [
        "evidence",
        "shift",
        "error",
    ]


def test_a_file_that_differs_from_torch_is_not_written(data, tmp_path, monkeypatch, capsys):
    run, out = tmp_path / "run", tmp_path / "made.onnx"
    assert train_correction.main([str(data), str(run), "--minutes", "0.01"]) == 0
    monkeypatch.setattr(export_correction, "TOLERANCE", -1.0)
    assert export_correction.main([str(run), str(out)]) == 2
    assert "differ by" in capsys.readouterr().err and not out.exists()


def test_data_that_cannot_be_used_is_named(data, tmp_path, capsys):
    (tmp_path / "empty").mkdir()
    assert train_correction.main([str(tmp_path / "empty"), str(tmp_path / "run")]) == 2
    assert "holds no rooms" in capsys.readouterr().err
    np.save(data / "room_0001" / "evidence.npy", np.zeros((6, 3, HEIGHT, WIDTH), np.float16))
    with pytest.raises(InputError, match="room_0001 is of another version"):
        read_rooms(data)
    (data / "room_0000" / "evidence.npy").write_bytes(b"\x93NUMPY")
    with pytest.raises(InputError, match="room_0000 cannot be read"):
        read_rooms(data)
