"""Does the paper's ordering hold? Every pair of rows with its margin against the spread over seeds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise

from room2dgs.study.ablation import FULL, Row, Study, Value, difference

# Table II of the paper, best first: row -> F-score on ScanNet.
TABLE_II = {FULL: 0.575, "no_mv": 0.566, "no_normal": 0.520, "no_depth": 0.438, "no_seed": 0.307}
BASELINES = ("plain_2dgs", "no_seed")


@dataclass(frozen=True)
class Pair:
    """Two rows of which the paper has the first above the second.

    Attributes:
        margin: F-score of the first minus that of the second.
        paper: the same in Table II.
    """

    better: str
    worse: str
    margin: Value
    paper: float

    @property
    def holds(self) -> bool:
        return self.margin.mean > 0

    @property
    def clear(self) -> bool | None:
        """Whether the margin is larger than its spread; None with a single seed."""
        return None if self.margin.spread is None else abs(self.margin.mean) > self.margin.spread


def pairs_of(rows: Sequence[Row]) -> list[Pair]:
    """All pairs of Table II that the study has, in the paper's order; rows with the same settings left out."""
    by_name = {row.name: row for row in rows if row.name in TABLE_II and not row.same_as}
    found = []
    for better, worse in combinations([name for name in TABLE_II if name in by_name], 2):
        margin = difference(by_name[better], by_name[worse], "f_score")
        if margin is not None:
            found.append(Pair(better, worse, margin, TABLE_II[better] - TABLE_II[worse]))
    return found


def order_sentences(study: Study) -> list[str]:
    """What holds of Table II's ordering, line by line: neighbours first, then every pair that is the wrong way."""
    pairs = pairs_of(study.rows)
    present = [name for name in TABLE_II if any(name in (pair.better, pair.worse) for pair in pairs)]
    if not pairs:
        return ["Table II's ordering: fewer than two of its rows have an F-score here, nothing to compare"]
    wrong = [pair for pair in pairs if not pair.holds]
    missing = [name for name in TABLE_II if name not in present]
    without = f" (without {', '.join(missing)})" if missing else ""
    lines = [f"Table II's ordering by F @ {study.at}, {' > '.join(present)}{without}: {_verdict(wrong)}"]
    neighbours = list(pairwise(present))
    lines += [_line(pair) for pair in pairs if (pair.better, pair.worse) in neighbours]
    lines += [_line(pair) for pair in wrong if (pair.better, pair.worse) not in neighbours]
    return lines


def ratio_sentences(study: Study) -> list[str]:
    """The full model against the baselines: ratio of F-scores and of primitives."""
    by_name = {row.name: row for row in study.rows if "f_score" in row.values}
    full = by_name.get(FULL)
    lines = []
    for name in BASELINES if full else ():
        base = by_name.get(name)
        if base is None or full is None or base.values["f_score"].mean <= 0:
            continue
        ratio = full.values["f_score"].mean / base.values["f_score"].mean
        line = f"F @ {study.at}, {FULL} / {name}: {ratio:.2f}"
        if "primitives" in full.values and base.values.get("primitives"):
            line += f", with {full.values['primitives'].mean / base.values['primitives'].mean:.2f} times the surfels"
        lines.append(line)
    return lines


def _verdict(wrong: list[Pair]) -> str:
    if not wrong:
        return "it holds"
    return "it does NOT hold for " + ", ".join(f"{pair.better} > {pair.worse}" for pair in wrong)


def _line(pair: Pair) -> str:
    said = "holds" if pair.holds else "does NOT hold"
    if pair.clear is None:
        against = "one seed, no spread"
    else:
        size = "more" if pair.clear else "less"
        against = f"{size} than the spread of {pair.margin.spread:.3f}"
    return f"{pair.better} > {pair.worse}: {said}, by {pair.margin.mean:+.3f} ({against}; paper {pair.paper:+.3f})"
