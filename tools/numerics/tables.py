"""The measured rows as tables."""

from __future__ import annotations

from functools import partial
from typing import Any

from room2dgs.report.table import NOTHING, Table, table
from room2dgs.tools.numerics.compare import GRADIENTS

Row = dict[str, Any]


def number(x: float | None) -> str:
    """Two digits; "bits" where nothing differs at all."""
    if x is None:
        return NOTHING
    return "0" if x == 0 else f"{x:.1e}"


def _same(x: float | None) -> str:
    return "bits" if x == 0 else number(x)


def _verdict(row: Row) -> str:
    return "pass" if row["passed"] else ("FAIL" if row["finite"] else "FAIL, not finite")


def tables(found: dict[str, list[Row]]) -> list[Table]:
    """Of `measure.measured`'s rows; kinds without rows have none."""
    made = []
    if rows := found.get("raster", []):
        columns = {"case": lambda r: r["case"], "images": lambda r: number(max(r["images"].values()))}
        columns |= {name: partial(lambda name, r: number(r["gradients"][name]), name) for name in GRADIENTS}
        columns |= {
            name: partial(lambda name, r: _same(r["invariances"][name]) if "invariances" in r else NOTHING, name)
            for name in ("moved", "scaled", "reordered", "threads")
        }
        columns |= {"bound": lambda r: number(r["bound"]), "": _verdict}
        made.append(table("Rasterizer: worst relative error of images and of each gradient, and what must not matter",
                          columns, rows))  # fmt: skip
        pairs = [row for row in rows if "forms" in row]
        parts = {"opacity": ("centre form", "three planes"), "depth": ("centre form", "three planes"),
                 "distortion": ("shifted", "running sums")}  # fmt: skip
        columns = {"case": lambda r: r["case"]} | {
            f"{part}, {form}": partial(lambda part, k, r: number(r["forms"][part][k]), part, k)
            for part, forms in parts.items()
            for k, form in enumerate(forms)
        }
        if pairs:
            made.append(table("Forms side by side in float32: worst errors", columns, pairs))
    if rows := found.get("terms", []):
        columns = {
            "case": lambda r: r["case"],
            "value": lambda r: number(r["value"]),
            "gradients": lambda r: ", ".join(f"{name} {number(x)}" for name, x in r["gradients"].items()),
            "bound": lambda r: number(r["bound"]),
            "": _verdict,
        }
        made.append(table("Loss terms: worst relative errors", columns, rows))
    if rows := found.get("stages", []):
        columns = {
            "case": lambda r: r["case"],
            "asked": lambda r: r["asked"],
            "found": lambda r: number(r["off"]),
            "bound": lambda r: number(r["bound"]),
            "threads": lambda r: "bits" if r["same"] else "differ",
            "": _verdict,
        }
        made.append(table("Stereo and joint depth", columns, rows))
    return made
