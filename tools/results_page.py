"""docs/results.md: one page of numbers, all of one commit, by one command.

    python -m room2dgs.tools.results_page WORK CAPTURE... [KEY=VALUE ...]

It makes and reconstructs the demo room, runs `room2dgs bench suite` on the captures (`scene.frames=24 experiment=quick`
unless settings are given) and `room2dgs bench raster --quick`. Everything is kept in WORK/<commit>, so that the same
command goes on where it was stopped. At the end it writes the figures to tools/study_tables/results.json, and from
these docs/results.md and the scores in README.md. Files must be committed, and WORK must lie outside the checkout.
"""

from __future__ import annotations

import json
import re
import shlex
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from room2dgs.commit import commit
from room2dgs.errors import InputError, RunFailed
from room2dgs.files import whole_file
from room2dgs.report.table import markdown, table
from room2dgs.tools.command_line import command_line

ROOT = Path(__file__).resolve().parents[1]
FIGURES, PAGE, README = ROOT / "tools/study_tables/results.json", ROOT / "docs/results.md", ROOT / "README.md"
MADE = "<!-- written by `python -m room2dgs.tools.results_page`; do not edit -->"
SCORES = re.compile(r"(<!-- scores -->\n).*?(<!-- end of scores -->)", re.DOTALL)
SETTINGS = ("scene.frames=24", "experiment=quick")
DEMO_SETTINGS = ("prior=room_prior",)
# what is known of captures that reports name; others are called by their folder alone
CAPTURES = {
    "greywhite": "path-traced living room: blank grey walls, gloss, overexposed windows (scene by Wig42, CC BY 3.0)",
    "bathroom": "path-traced bathroom, one half of it bare light walls (scene by nacimus, CC BY 3.0)",
    "redkitchen": "real, of 7-Scenes; its truth is fused from the depth sensor, and not exact to the centimetre",
}
EMPTY = f"""{MADE}

# Numbers

The figures of this version have not been measured yet. One command measures them and writes this page:

```bash
python -m room2dgs.tools.results_page WORK CAPTURE...
```

It takes some minutes for the demo room and three captures, and goes on where it was stopped.
"""


@command_line("results_page")
def main(argv: list[str]) -> int:
    """Measure what is not measured yet, and write the page; 0, or 2 for bad input."""
    places = [text for text in argv if "=" not in text]
    if not places or "-h" in argv or "--help" in argv:
        print(__doc__)
        return 0 if argv else 2
    of = commit()
    if not of:
        raise InputError(
            "the commit is not known; run this in a checkout with git, so that the numbers are of one commit"
        )
    work = Path(places[0]) / of[:12]
    settings = [text for text in argv if "=" in text] or list(SETTINGS)
    figures = measured(work.absolute(), places[1:], settings, of)
    whole(FIGURES, json.dumps(figures, indent=1, ensure_ascii=False) + "\n")
    whole(PAGE, page(figures))
    whole(README, with_scores(README.read_text(encoding="utf-8"), figures))
    print(f"{PAGE}: {figures['commit'][:12]}, {figures['machine']}")
    return 0


def measured(work: Path, captures: Sequence[str], settings: Sequence[str], of: str) -> dict[str, Any]:
    """The figures of this commit; what lies in `work` already is not run again.

    Raises:
        RunFailed: a command failed; the same command goes on after the cause is mended.
        InputError: a run in `work` is of another commit.
    """
    room, run, raster = work / "demo_room", work / "demo", work / "raster.json"
    if not (room / "gt_mesh.ply").is_file():
        room2dgs("demo", str(room), "--overwrite")
    if not (run / "report.html").is_file():
        go_on = ["resume=true"] if (run / "config.yaml").is_file() else []
        room2dgs("run", f"scene.path={room}", f"out={run}", *DEMO_SETTINGS, *go_on)
    suite: Mapping[str, Any] = {"rows": [], "settings": []}
    if captures:
        room2dgs("bench", "suite", *captures, f"out={work / 'suite'}", *settings)
        suite = json.loads((work / "suite/suite.json").read_text(encoding="utf-8"))
    if not raster.is_file():
        room2dgs("bench", "raster", "--quick", "--json", str(raster))
    demo = json.loads((run / "metrics.json").read_text(encoding="utf-8"))
    speed = json.loads(raster.read_text(encoding="utf-8"))
    for made in (demo["commit"], speed["commit"], *suite.get("commits", [])):
        if made != of:
            raise InputError(f"{work} holds figures of {made}; remove it, so that all are of {of}")
    told = demo["machine"]
    return {
        "commit": of,
        "versions": {name: demo["versions"][name] for name in ("room2dgs", "python", "torch", "pycolmap", "open3d")},
        "machine": f"{told['processor']}, {told['cores']} cores, {told['memory_gb']:.0f} GB, {told['system']}",
        "settings": list(settings) if captures else [],
        "demo": demo_figures(demo),
        "suite": [suite_figures(row) for row in suite["rows"]],
        "raster": [{key: one[key] for key in RASTER.values()} for one in speed["cases"]],
        "isa": speed["isa"],
        "threads": speed["threads"],
    }


def room2dgs(*arguments: str) -> None:
    """Run a verb in a process of its own.

    Raises:
        RunFailed: it failed.
    """
    command = [sys.executable, "-m", "room2dgs", *arguments]
    print(f"$ room2dgs {shlex.join(arguments)}", flush=True)
    code = subprocess.run(command, check=False).returncode
    if code:
        raise RunFailed(f"room2dgs {arguments[0]} ended with {code}", code)


DEMO = {
    "F @ 5 cm": "f_score_5cm", "precision": "precision_5cm", "recall": "recall_5cm", "F @ 2 cm": "f_score_2cm",
    "PSNR": "psnr_db", "seconds": "seconds", "CPU seconds": "cpu_seconds", "surfels": "primitives",
    "memory": "memory_gb",
}  # fmt: skip
SUITE = {
    "F @ 5 cm": "f_score", "precision": "precision", "recall": "recall", "F @ 2 cm": "f_score_2cm", "seconds": "run_s",
    "surfels": "primitives", "memory": "peak_memory_mb",
}  # fmt: skip
RASTER = {
    "width": "width", "height": "height", "surfels": "surfels", "pairs a pixel": "pairs_per_pixel",
    "forward": "forward_ms", "backward": "backward_ms",
}  # fmt: skip


def demo_figures(metrics: Mapping[str, Any]) -> dict[str, float | None]:
    """What the page says of a run."""
    area = metrics["protocols"]["area"]
    return {
        "f_score_5cm": area["f_score_5cm"],
        "precision_5cm": area["precision_5cm"],
        "recall_5cm": area["recall_5cm"],
        "f_score_2cm": area["f_score_2cm"],
        "psnr_db": metrics.get("psnr_db"),
        "seconds": sum(metrics["seconds"].values()),
        "cpu_seconds": sum(metrics["cpu_seconds"].values()),
        "primitives": metrics["primitives"],
        "memory_gb": metrics["peak_memory_mb"] / 1000,
    }


def suite_figures(row: Mapping[str, Any]) -> dict[str, Any]:
    """What the page says of a capture."""
    values = {name: value["mean"] for name, value in row["values"].items()}
    return {"name": row["name"], **{key: values.get(key) for key in SUITE.values()}}


def page(figures: Mapping[str, Any] | None) -> str:
    """docs/results.md. None: nothing was measured yet."""
    if figures is None:
        return EMPTY
    versions = ", ".join(f"{name} {version}" for name, version in figures["versions"].items())
    lines = [
        MADE,
        "\n# Numbers\n",
        f"All figures are of commit `{figures['commit'][:12]}`, from photos alone, one run each.\n",
        f"- **Machine**: {figures['machine']}; kernels {figures['isa']}\n- **Versions**: {versions}",
        "- **Command**: `python -m room2dgs.tools.results_page WORK CAPTURE...`; it writes this page\n",
        "Scores are of the protocol `area` ([Score a mesh](how-to/score.md)). Seconds are of everything but scoring, "
        "unless the table says otherwise, memory is the peak.\n",
        "## The demo room\n",
        f"`make demo`, that is `room2dgs run scene.path=demo/room out=demo/run {' '.join(DEMO_SETTINGS)}`: 60 photos "
        "of 320×240, default settings. Seconds are of the whole run, with scoring and pictures.\n",
        markdown(table("", _columns(DEMO), [figures["demo"]])),
    ]
    if figures["suite"]:
        named = [one["name"] for one in figures["suite"]]
        lines += [
            "\n## Captures\n",
            f"`room2dgs bench suite {' '.join(named)} out=suite {' '.join(figures['settings'])}`. These settings are a "
            "quick look that takes minutes; the default settings with all photos score higher.\n",
            markdown(table("", {"capture": lambda one: one["name"], **_columns(SUITE)}, figures["suite"])),
            *(["", *(f"- *{name}*: {CAPTURES[name]}" for name in named if name in CAPTURES)]),
        ]
    lines += [
        "\n## The rasterizer\n",
        f"`room2dgs bench raster --quick`, {figures['threads']} threads, milliseconds of one view with colour, depth "
        "and normals; `room2dgs bench raster` has more sizes and the stages of an iteration.\n",
        markdown(table("", {"image": _image, **_columns(dict(list(RASTER.items())[2:]))}, figures["raster"])),
        "\n## On a GPU\n",
        "Not measured by this command, which needs no GPU: see [the study](studies/gpu.md).",
    ]
    return "\n".join(lines) + "\n"


def _columns(figures: Mapping[str, str]) -> dict[str, Callable[[Any], str]]:
    return {head: partial(lambda key, one: shown(one, key), key) for head, key in figures.items()}


def _image(case: Mapping[str, Any]) -> str:
    return f"{case['width']}×{case['height']}"


def shown(values: Mapping[str, Any], key: str) -> str:
    """A figure as text."""
    value = values.get(key)
    if value is None:
        return "—"
    if key == "psnr_db":
        return f"{value:.1f} dB"
    if key.startswith(("f_score", "precision", "recall")):
        return f"{value:.3f}"
    if key in ("memory_gb", "peak_memory_mb"):
        return f"{value / (1000 if key.endswith('mb') else 1):.1f} GB"
    return f"{value:,.1f}" if key.endswith("_ms") else f"{value:,.0f}"


def with_scores(readme: str, figures: Mapping[str, Any] | None) -> str:
    """README.md with today's scores between its two marks."""
    return SCORES.sub(lambda found: found[1] + sentence(figures) + found[2], readme)


def sentence(figures: Mapping[str, Any] | None) -> str:
    """The scores, for README.md."""
    if figures is None:
        return "`make demo` prints about 0.96.\n"
    demo, machine = figures["demo"], figures["machine"].split(", Linux")[0]
    text = f"`make demo` prints {shown(demo, 'f_score_5cm')}, after {demo['seconds']:.0f} seconds on {machine}.\n"
    if figures["suite"]:
        scores = ", ".join(f"{one['name']} {shown(one, 'f_score')}" for one in figures["suite"])
        text += f"`room2dgs bench suite` with `{' '.join(figures['settings'])}`: {scores}.\n"
    return text


def stored() -> dict[str, Any] | None:
    """The figures that the page is of."""
    return json.loads(FIGURES.read_text(encoding="utf-8")) if FIGURES.is_file() else None


def whole(path: Path, text: str) -> None:
    """Write a text file as a whole."""
    with whole_file(path) as temporary:
        Path(temporary).write_text(text, encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
