"""Is a run good, usable or failed? Rules over what the run itself can measure, without a ground truth."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from enum import IntEnum
from typing import Any, NamedTuple

VERDICT = "verdict"  # in metrics.json

LITTLE_COVERAGE, FULL_COVERAGE = 0.5, 0.75  # of the pixels of the training views
POOR_AGREEMENT, GOOD_AGREEMENT = 0.5, 0.75  # correlation of photos over the mesh
BAD_PSNR_DB, POOR_PSNR_DB = 10.0, 16.0  # of held-out views
LITTLE_STEREO, FEW_POINTS = 0.45, 100  # share of the pixels; sparse points
LITTLE_TRUSTED = 0.35  # share of the pixels that have at least half of the confidence
CONTRADICTING_SCALES, SPREAD_SCALES = 3.5, 2.5  # 95th over 5th percentile of the network's scales
LEAST_SCALES = 5  # views: fewer scales say nothing of their spread
MOST_LEFT_OUT, SOME_LEFT_OUT = 0.5, 0.1  # of the photos
WRONG_UNIT = 2.0  # factor between the network's metres and the poses'


class Level(IntEnum):
    """How bad a reason is; the worst reason decides."""

    GOOD = 0
    USABLE = 1
    FAILED = 2

    @property
    def word(self) -> str:
        """As it is written: "good", "usable" or "failed"."""
        return self.name.lower()


class Reason(NamedTuple):
    """Why a run is not good.

    Attributes:
        level: what the verdict is at best.
        sentence: what was measured.
        advice: what to do about it.
    """

    level: Level
    sentence: str
    advice: str


@dataclass(frozen=True)
class Measures:
    """What is known of a run; None: it was not measured, and no rule speaks of it.

    Attributes:
        coverage: share of the training views' pixels that the mesh covers.
        photo_agreement: median correlation, -1..1, of photos with their neighbours over the mesh.
        psnr_db: mean PSNR of the held-out views' renderings.
        nearest_psnr_db: the same if the nearest training photo, as it is, stands for each rendering.
        stereo_coverage: share of the pixels that stereo gave a depth.
        points: number of sparse points.
        trusted: share of the pixels whose depth has at least half of the confidence.
        scale_ratio: 95th over 5th percentile of the scales that fit the network's depth to the points, by view.
        left_out: share of the capture's photos that were not used because they have no pose or cannot be read.
        prior_scale: metres of the run in a metre of the depth network, median over the views.
        unit: scene.unit as the user gave it.
        points_alone: whether the mesh joins the sparse points and nothing else.
    """

    coverage: float | None = None
    photo_agreement: float | None = None
    psnr_db: float | None = None
    nearest_psnr_db: float | None = None
    stereo_coverage: float | None = None
    points: int | None = None
    trusted: float | None = None
    scale_ratio: float | None = None
    left_out: float | None = None
    prior_scale: float | None = None
    unit: float | None = None
    points_alone: bool | None = None


@dataclass(frozen=True)
class Verdict:
    """What a run says of itself.

    Attributes:
        word: "good", "usable" or "failed".
        reasons: why it is not good, the worst first; none if it is.
        advice: what to do, a sentence each.
        measures: the figures that decided, by their names in `Measures`.
        notes: what a person should know whatever the word, such as photos that were left out.
    """

    word: str
    reasons: tuple[str, ...] = ()
    advice: tuple[str, ...] = ()
    measures: Mapping[str, float | bool | None] | None = None
    notes: tuple[str, ...] = ()

    @property
    def failed(self) -> bool:
        """Whether the run is of no use."""
        return self.word == Level.FAILED.word

    def lines(self) -> list[str]:
        """For the log."""
        return [
            f"verdict: {self.word}",
            *(f"  because {reason}" for reason in self.reasons),
            *(f"  to do: {advice}" for advice in self.advice),
            *(f"  note: {note}" for note in self.notes),
        ]

    def as_dict(self) -> dict[str, Any]:
        """For metrics.json."""
        return {
            "word": self.word,
            "reasons": list(self.reasons),
            "advice": list(self.advice),
            "measures": dict(self.measures or {}),
            "notes": list(self.notes),
        }


def verdict_of(measures: Measures) -> Verdict:
    """The worst of what the rules find."""
    found = [reason for rule in RULES if (reason := rule(measures)) is not None]
    found.sort(key=lambda reason: -reason.level)
    word = max((reason.level for reason in found), default=Level.GOOD).word
    advice = dict.fromkeys(reason.advice for reason in found)
    figures = {name: value for name, value in asdict(measures).items() if value is not None}
    return Verdict(word, tuple(reason.sentence for reason in found), tuple(advice), figures)


def noted_verdict(metrics: Mapping[str, Any]) -> Verdict | None:
    """What a run's metrics.json says; None: the run was not judged."""
    noted = metrics.get(VERDICT)
    if noted is None:
        return None
    reasons, advice, notes = (tuple(noted.get(name, ())) for name in ("reasons", "advice", "notes"))
    return Verdict(noted["word"], reasons, advice, noted.get("measures"), notes)


def covered(measures: Measures) -> Reason | None:
    """The mesh ought to be where the cameras look."""
    share = measures.coverage
    if share is None or share >= FULL_COVERAGE:
        return None
    sentence = f"the mesh covers {share:.0%} of what the photos show"
    if wrong_unit(measures):
        return Reason(_level(share < LITTLE_COVERAGE), sentence, _unit_advice(measures))
    advice = (
        "film the missing parts from more places, or keep depth that is less sure: mesh.max_expected_m=null, and "
        "mesh.max_depth_m if the room is deeper than that"
    )
    return Reason(_level(share < LITTLE_COVERAGE), sentence, advice)


def photos_agree(measures: Measures) -> Reason | None:
    """Photos that are drawn into each other over a true surface with true poses look alike."""
    value = measures.photo_agreement
    if value is None or value >= GOOD_AGREEMENT:
        return None
    sentence = (
        f"photos do not fit each other over the mesh (correlation {value:.2f}; {GOOD_AGREEMENT} and more is good)"
    )
    advice = (
        "check poses and intrinsics (sfm.refine_poses=true refines them), or make them anew from the photos: "
        "room2dgs prepare images=DIR out=DIR"
    )
    return Reason(_level(value < POOR_AGREEMENT), sentence, advice)


def held_out_views(measures: Measures) -> Reason | None:
    """A rendering ought to show a photo that was held out better than another photo does."""
    value, nearest = measures.psnr_db, measures.nearest_psnr_db
    if value is None or value >= POOR_PSNR_DB:
        return None
    sentence = f"held-out photos are rendered with {value:.1f} dB"
    beaten = nearest is not None and value < nearest
    if beaten:
        sentence += f", worse than their nearest photo as it is ({nearest:.1f} dB)"
    advice = "check the poses, train longer (train.iterations), and film with steady light"
    return Reason(_level(value < BAD_PSNR_DB or beaten), sentence, advice)


def stereo(measures: Measures) -> Reason | None:
    """With little stereo and few points the network's guess is most of the depth."""
    share, points = measures.stereo_coverage, measures.points
    if share is None or points is None or share >= LITTLE_STEREO or points >= FEW_POINTS:
        return None
    sentence = (
        f"stereo measured {share:.0%} of the pixels, with {points} sparse points: most depth is the network's guess"
    )
    return Reason(Level.USABLE, sentence, "film with more texture in view, more light, and steps to the side")


def joined_points(measures: Measures) -> Reason | None:
    """Photos are compared where they have texture, and so have points: between these nothing was measured."""
    if not measures.points_alone:
        return None
    sentence = "the mesh joins sparse points: what lies between them, blank walls above all, is a guess"
    return Reason(Level.USABLE, sentence, "mesh.source=depth measures these parts in minutes, a run with training best")


def expected_error(measures: Measures) -> Reason | None:
    """Depth that the run itself does not believe."""
    share = measures.trusted
    if share is None or share >= LITTLE_TRUSTED:
        return None
    sentence = f"only {share:.0%} of the pixels have a depth that the run is sure of"
    return Reason(Level.USABLE, sentence, "film it from more places, so that each part is seen by several photos")


def scales_agree(measures: Measures) -> Reason | None:
    """One room has one scale: what the network has to be multiplied by may not jump from view to view."""
    ratio = measures.scale_ratio
    if ratio is None or ratio < SPREAD_SCALES:
        return None
    sentence = f"the scale of the network's depth differs {ratio:.1f} times between views"
    advice = "check the poses of the capture: parts of it may have different scales, or photos another one's pose"
    return Reason(_level(ratio >= CONTRADICTING_SCALES), sentence, advice)


def photos_used(measures: Measures) -> Reason | None:
    """Photos without a pose are parts of the room that are not there."""
    share = measures.left_out
    if share is None or share < SOME_LEFT_OUT:
        return None
    sentence = f"{share:.0%} of the photos were left out"
    return Reason(
        _level(share >= MOST_LEFT_OUT), sentence, "see in the log why they were left out, and mend or film them again"
    )


def wrong_unit(measures: Measures) -> bool:
    """Whether the network contradicts the unit of the poses."""
    scale = measures.prior_scale
    return scale is not None and not 1 / WRONG_UNIT < scale < WRONG_UNIT


def unit(measures: Measures) -> Reason | None:
    """Lengths in settings are metres: with a wrong unit all of them are wrong."""
    scale = measures.prior_scale
    if scale is None or not wrong_unit(measures):
        return None
    sentence = f"one metre of this run is about {1 / scale:.2g} m by the depth network"
    return Reason(Level.USABLE, sentence, _unit_advice(measures))


Rule = Callable[[Measures], Reason | None]
RULES: tuple[Rule, ...] = (
    covered,
    photos_agree,
    held_out_views,
    scales_agree,
    photos_used,
    stereo,
    joined_points,
    expected_error,
    unit,
)


def _level(failed: bool) -> Level:
    return Level.FAILED if failed else Level.USABLE


def _unit_advice(measures: Measures) -> str:
    unit_m = (measures.unit or 1.0) / (measures.prior_scale or 1.0)
    return f"give scene.unit={unit_m:.2g}, the metres of one unit of the poses"
