"""An ablation's numbers: means, spreads, differences, the paper's ordering."""

from __future__ import annotations

import json
import re
import statistics
from pathlib import Path

import pytest

from room2dgs.report.table import markdown
from room2dgs.study.ablation import Run, Study, difference, rows_of
from room2dgs.study.ablation_order import order_sentences, pairs_of, ratio_sentences
from room2dgs.study.ablation_report import write_page, write_tables
from room2dgs.study.ablation_tables import cost_table, score_table, stage_table

WORDS = {"full": "the whole method", "no_depth": "without the depth prior"}


def metrics(f: float, seconds: float = 120.0, surfels: int = 1000, **more) -> dict:
    return {
        "f_score_5cm": f, "precision_5cm": f, "recall_5cm": f, "accuracy_m": 0.05, "completion_m": 0.1,
        "protocol": "area", "protocols": {"area": {"f_score_2cm": f / 2}}, "psnr_db": 25.0, "primitives": surfels,
        "peak_memory_mb": 1500.0, "seconds": {"points": 60.0, "train": seconds, "mesh": 60.0}, "priors": "files",
        "training_seconds": {"render": seconds / 2, "loss": seconds / 4}, **more,
    }  # fmt: skip


def run(row: str, seed: int, found: dict | None, **more) -> Run:
    return Run(row, seed, Path(f"{row}/seed_{seed}"), found, **more)


def study(*runs: Run) -> Study:
    return Study("Ablation of a room", "room2dgs ablate x", 0.05, rows_of(runs, WORDS, 0.05))


def column(table, name: str) -> dict[str, str]:
    return dict(zip(table.frame.iloc[:, 0], table.frame[name], strict=True))


def test_mean_and_spread_over_seeds_and_difference_to_full():
    scores = (0.50, 0.56, 0.53)
    one = study(
        *(run("full", seed, metrics(f)) for seed, f in enumerate(scores)),
        *(run("no_depth", seed, metrics(f - 0.1, surfels=3000)) for seed, f in enumerate(scores)),
    )
    spread = statistics.stdev(scores)
    full, without = one.rows
    assert full.values["f_score"].mean == pytest.approx(0.53)
    assert full.values["f_score"].spread == pytest.approx(spread)
    gain = difference(full, without, "f_score")
    assert gain.mean == pytest.approx(0.1)
    assert gain.spread == pytest.approx(2**0.5 * spread)
    table = score_table(one)
    assert column(table, "F @ 5cm")["full"] == "0.530 ± 0.030"
    assert column(table, "ΔF to full") == {"full": "-", "no_depth": "-0.100 ± 0.042"}
    assert column(table, "F @ 2cm")["full"] == "0.265 ± 0.015"
    assert column(table, "acc. (cm)")["full"] == "5.0 ± 0.0"
    assert column(table, "surfels")["no_depth"] == "3,000 ± 0"
    assert column(table, "train (min)")["full"] == "2.0 ± 0.0"
    assert column(table, "memory (GB)")["full"] == "1.5 ± 0.0"
    assert "seeds 0, 1, 2" in table.title


def test_a_single_seed_has_no_spread():
    table = score_table(study(run("full", 4, metrics(0.5))))
    assert column(table, "F @ 5cm")["full"] == "0.500"
    assert table.title == "Scores, seed 4"


def test_what_a_part_gives_and_costs_has_the_sign_of_full_minus_without():
    one = study(run("full", 0, metrics(0.6, seconds=300.0)), run("no_depth", 0, metrics(0.4, seconds=180.0)))
    table = cost_table(one)
    assert column(table, "F gained") == {"no_depth": "+0.200"}
    assert column(table, "train + mesh minutes added") == {"no_depth": "+2.0"}
    assert column(table, "the part") == {"no_depth": "without the depth prior"}
    assert cost_table(study(run("no_depth", 0, metrics(0.4)))) is None


def test_stages_are_means_and_a_stage_that_a_row_lacks_is_no_zero():
    extra = metrics(0.5, training_seconds={"render": 10.0, "multiview": 4.0})
    table = stage_table(study(run("full", 0, extra), run("no_mv", 0, metrics(0.5, seconds=40.0))))
    assert list(table.frame.columns) == ["row", "render", "multiview", "loss", "all"]
    assert table.frame.to_numpy().tolist() == [
        ["full", "10.0", "4.0", "-", "14.0"],
        ["no_mv", "20.0", "-", "10.0", "30.0"],
    ]


def test_failed_and_unfinished_rows_say_so_and_have_no_number():
    one = study(
        run("full", 0, metrics(0.5)),
        run("full", 1, None, failed="the disk is full"),
        run("no_mv", 0, None, failed="no memory"),
        run("no_mv", 1, None),
        run("no_depth", 0, None),
    )
    names = list(column(score_table(one), "F @ 5cm").items())
    assert names == [("full (1 of 2 seeds)", "0.500"), ("no_mv (failed)", "-"), ("no_depth (not run yet)", "-")]


def test_a_run_without_ground_truth_has_its_other_figures():
    found = {"psnr_db": 20.0, "primitives": 5, "f_score_5cm": None, "seconds": {"train": 60.0}}
    table = score_table(study(run("full", 0, found)))
    assert column(table, "PSNR (dB)")["full"] == "20.0"
    assert column(table, "F @ 5cm")["full"] == "-"
    assert column(table, "priors")["full"] == "none"


def order(**scores: float | tuple[float, ...]) -> Study:
    runs = []
    for row, values in scores.items():
        each = values if isinstance(values, tuple) else (values,)
        runs += [run(row, seed, metrics(value)) for seed, value in enumerate(each)]
    return study(*runs)


def test_the_papers_own_numbers_hold_in_every_pair():
    one = order(no_seed=0.307, no_depth=0.438, full=0.575, no_normal=0.520, no_mv=0.566)
    pairs = pairs_of(one.rows)
    assert len(pairs) == 10 and all(pair.holds for pair in pairs)
    assert all(pair.margin.mean == pytest.approx(pair.paper) for pair in pairs)
    lines = order_sentences(one)
    assert lines[0] == ("Table II's ordering by F @ 5cm, full > no_mv > no_normal > no_depth > no_seed: it holds")
    assert lines[1].startswith("full > no_mv: holds, by +0.009 (one seed, no spread; paper +0.009)")
    assert len(lines) == 5


def test_wrong_pairs_are_named_neighbours_or_not():
    one = order(full=0.5, no_mv=0.51, no_normal=0.4, no_seed=0.45)
    lines = order_sentences(one)
    assert "(without no_depth)" in lines[0]
    assert lines[0].endswith("it does NOT hold for full > no_mv, no_normal > no_seed")
    one = order(full=0.5, no_mv=0.6, no_normal=0.55)
    lines = order_sentences(one)
    assert lines[0].endswith("NOT hold for full > no_mv, full > no_normal")
    assert [line.split(":")[0] for line in lines[1:]] == ["full > no_mv", "no_mv > no_normal", "full > no_normal"]


def test_a_margin_is_weighed_against_the_spread():
    clear, unclear = (
        order_sentences(order(full=(0.6, 0.61), no_mv=(0.5, 0.51))),
        order_sentences(order(full=(0.6, 0.5), no_mv=(0.54, 0.52))),
    )
    assert "by +0.100 (more than the spread of 0.010" in clear[1]
    assert "by +0.020 (less than the spread of 0.072" in unclear[1]


def test_equal_scores_do_not_hold():
    assert order_sentences(order(full=0.5, no_mv=0.5))[0].endswith("it does NOT hold for full > no_mv")


def test_one_row_has_no_order():
    assert "nothing to compare" in order_sentences(order(full=0.5))[0]


def test_a_row_with_the_settings_of_another_is_not_weighed_against_it():
    one = study(
        run("full", 0, metrics(0.5)), run("no_mv", 0, metrics(0.5), same_as="full"), run("no_seed", 0, metrics(0.4))
    )
    assert [(pair.better, pair.worse) for pair in pairs_of(one.rows)] == [("full", "no_seed")]
    assert "no_mv (same settings as full)" in column(score_table(one), "row")
    assert list(column(cost_table(one), "F gained")) == ["no_seed"]


def test_ratio_to_the_baseline():
    one = study(run("full", 0, metrics(0.6, surfels=500)), run("plain_2dgs", 0, metrics(0.3, surfels=1000)))
    assert ratio_sentences(one) == ["F @ 5cm, full / plain_2dgs: 2.00, with 0.50 times the surfels"]


def test_files_hold_the_tables_and_simulated_priors_are_labelled_everywhere(tmp_path):
    plain = study(run("full", 0, metrics(0.5, commit="a")), run("no_mv", 0, metrics(0.4, commit="b")))
    text = write_tables(plain, tmp_path)
    assert "simulated" not in text
    assert "made by 2 commits: a, b" in text
    assert "sparse points: 1.0 min" in text
    labelled = study(run("full", 0, metrics(0.5, priors="simulated")), run("no_depth", 0, metrics(0.4, priors="none")))
    text = write_tables(labelled, tmp_path)
    assert (tmp_path / "ablation.md").read_text(encoding="utf-8") == text
    titles = [line for line in text.splitlines() if re.match(r"\*\*(Scores|What|Seconds)", line)]
    assert len(titles) == 3 and all("simulated priors" in line for line in titles)
    assert column(score_table(labelled), "priors") == {"full": "simulated", "no_depth": "none"}
    saved = json.loads((tmp_path / "ablation.json").read_text())
    assert saved["simulated_priors"] is True
    assert saved["rows"][1]["values"]["f_score"] == {"mean": 0.4, "spread": None}
    assert saved["table_ii"][0]["holds"] is True
    write_page(labelled, tmp_path, scene=None, gt=None)
    assert "simulated priors" in (tmp_path / "ablation.html").read_text(encoding="utf-8")


def test_a_bar_in_a_reason_does_not_break_the_markdown():
    one = study(run("full|x", 0, metrics(0.5)))
    line = markdown(score_table(one)).splitlines()[-1]
    assert len(re.findall(r"(?<!\\)\|", line)) == score_table(one).frame.shape[1] + 1
