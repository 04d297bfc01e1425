"""Pages that are generated are as new as the code; results are of one set of figures."""

from __future__ import annotations

import itertools
import re
from dataclasses import fields

import pytest

from room2dgs.config.card import CardDepth, CardInput, CardNormal, read_card
from room2dgs.config.keys import leaf_keys
from room2dgs.depth.stages import STAGES
from room2dgs.registries.exporters import EXPORTERS
from room2dgs.registries.readers import READERS
from room2dgs.tools import docs_reference, results_page
from tests.docs.pages import DOCS, ROOT

FIGURES = {
    "commit": "0123456789abcdef", "versions": {"python": "3.11"}, "machine": "Some CPU, 2 cores, 25 GB, Linux x86_64",
    "settings": ["scene.frames=24"], "isa": "avx2", "threads": 2,
    "demo": {"f_score_5cm": 0.96, "seconds": 110.0, "psnr_db": 25.61, "memory_gb": 1.39, "primitives": 36316},
    "suite": [{"name": "greywhite", "f_score": 0.8512, "peak_memory_mb": 1210.0, "run_s": 61.2}],
    "raster": [{"width": 640, "height": 480, "surfels": 1000, "pairs_per_pixel": 33.3, "forward_ms": 1.26}],
}  # fmt: skip


@pytest.mark.parametrize("name", ["verbs.md", "settings.md", "names.md"])
def test_reference_pages_are_up_to_date(name):
    written = (DOCS / "reference" / name).read_text(encoding="utf-8")
    assert written == docs_reference.pages()[name], "run: python -m room2dgs.tools.docs_reference"


def test_the_page_of_settings_has_every_setting_once():
    text = (DOCS / "reference/settings.md").read_text(encoding="utf-8")
    assert re.findall(r"^ *\| `([\w.]+)` \|", text, re.MULTILINE) == sorted(
        (key.name for key in leaf_keys()), key=_place(leaf_keys())
    )


def _place(keys):
    sections = list(dict.fromkeys(key.name.partition(".")[0] if "." in key.name else "" for key in keys))
    order = {
        key.name: (sections.index(key.name.partition(".")[0] if "." in key.name else ""), not key.public, i)
        for i, key in enumerate(keys)
    }
    return order.get


def test_the_card_that_is_shown_is_one(tmp_path):
    text = (DOCS / "how-to/networks.md").read_text(encoding="utf-8")
    card = tmp_path / "model.json"
    card.write_text(re.findall(r"```json\n(.*?)```", text, re.DOTALL)[0], encoding="utf-8")
    read = read_card(card)
    assert read.depth.meaning == "relative_inverse_depth" and read.input.multiple == 14 and read.normal is None
    for kind in (CardInput, CardDepth, CardNormal):
        for field in fields(kind):
            assert f"`{field.name}`" in text, f"{field.name} of a card is on no page"


def test_results_and_scores_are_those_of_the_stored_figures():
    stored = results_page.stored()
    assert (DOCS / "results.md").read_text(encoding="utf-8") == results_page.page(stored)
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert results_page.with_scores(readme, stored) == readme


def test_a_page_of_results_says_commit_machine_settings_and_figures():
    page = results_page.page(FIGURES)
    for said in (
        "`0123456789ab`",
        "Some CPU",
        "scene.frames=24",
        "0.960",
        "25.6 dB",
        "36,316",
        "0.851",
        "1.2 GB",
        "1.3",
    ):
        assert said in page
    assert "| — " in page  # what was not measured


def test_the_scores_of_the_readme_are_replaced():
    text = "before\n<!-- scores -->\nold\n<!-- end of scores -->\nafter\n"
    new = results_page.with_scores(text, FIGURES)
    assert "old" not in new and "prints 0.960" in new and "greywhite 0.851" in new
    assert new.startswith("before\n") and new.endswith("<!-- end of scores -->\nafter\n")
    assert results_page.with_scores(new, FIGURES) == new


def test_results_of_several_commits_are_refused(tmp_path, monkeypatch):
    work = tmp_path / "abc"
    for path, text in {
        "demo_room/gt_mesh.ply": "", "demo/report.html": "",
        "demo/metrics.json": '{"commit": "other", "machine": {}, "versions": {}}', "raster.json": '{"commit": "abc"}',
    }.items():  # fmt: skip
        (work / path).parent.mkdir(parents=True, exist_ok=True)
        (work / path).write_text(text)
    monkeypatch.setattr(results_page, "room2dgs", lambda *words: pytest.fail(f"{words} ran again"))
    with pytest.raises(results_page.InputError, match=r"figures of other"):
        results_page.measured(work, [], [], "abc")


def _first_cells(page, header):
    lines = (DOCS / page).read_text(encoding="utf-8").splitlines()
    start = next(i for i, line in enumerate(lines) if line.startswith(f"| {header} |")) + 2
    rows = itertools.takewhile(lambda line: line.startswith("|"), lines[start:])
    return [name for row in rows for name in re.findall(r"`([^`]+)`", row.split("|")[1])]


def test_tables_by_hand_have_every_layout_and_format():
    layouts = [entry.name for entry in READERS.entries() if entry.package is None]
    assert _first_cells("reference/captures.md", "`scene.layout`") == layouts
    assert sorted(set(_first_cells("reference/captures.md", "layout"))) == sorted(layouts)
    formats = [entry.name for entry in EXPORTERS.entries() if entry.package is None]
    assert _first_cells("reference/exports.md", "`to=`") == formats


def test_the_page_of_depth_names_the_stages_in_their_order():
    text = (DOCS / "how-it-works/depth.md").read_text(encoding="utf-8")
    listed = re.findall(r"^\d+\. `(\w+)`", text, re.MULTILINE)
    assert listed == [stage.__name__ for stage in STAGES]
