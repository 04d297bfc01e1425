"""Where the depth of a run came from and how far it was trusted, in pictures and words."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from room2dgs.runs.trust import Trust

SURE = 3  # where stereo is worth so many photos that agree, it stands in its own right, as completion has it
STEREO, PRIOR, NOTHING = np.array([60, 170, 80]), np.array([70, 120, 220]), np.array([30, 30, 30])


def picture(one: Trust) -> np.ndarray:
    """(h, w, 3) uint8: green where stereo stands in its own right, else blue; as bright as it is trusted."""
    sure = one.confidence[..., None] / 255
    source = np.where((one.num_consistent >= SURE)[..., None], STEREO, PRIOR)
    return np.round(NOTHING + (source - NOTHING) * sure).astype(np.uint8)


def key(source: str) -> list[tuple[str, str]]:
    """Colours of the picture and what they mean."""
    return [
        (_css(STEREO), f"stereo: worth {SURE} photos that agree, or more"),
        (_css(PRIOR), other_source(source)),
        (_css(NOTHING), "not trusted, or no depth"),
        ("", "The brighter, the more it is trusted."),
    ]


def stereo_key() -> list[tuple[str, str]]:
    """Likewise where stereo is the only source."""
    return [
        (_css(STEREO), "stereo: the brighter, the more photos agree"),
        (_css(NOTHING), "no depth"),
    ]


def other_source(source: str) -> str:
    """The prior's source (`Priors.depth_source`) in words."""
    labels = {
        "sensor": "the capture's depth camera",
        "files": "depth files",
        "stereo": "stereo: fewer photos agree",
        "none": "no other source",
    }
    return labels.get(source, f"network ({source})")


def sentences(maps: Mapping[str, Trust], source: str) -> list[str]:
    """Shares over the views that maps were kept of."""
    if not maps:
        return []
    stereo = np.concatenate([(one.num_consistent >= SURE).ravel() for one in maps.values()])
    confidence = np.concatenate([one.confidence.ravel() for one in maps.values()]) / 255
    lines = [f'Measured on {len(maps)} training views; their pictures are above, under "where depth was trusted".']
    if source != "sensor":
        lines.append(
            f"Stereo stands in its own right (worth {SURE} photos that agree, or more) in {stereo.mean():.0%} of the "
            f"pixels; trusted {_mean(confidence[stereo]):.0%} there on average."
        )
    rest = ~stereo & (confidence > 0)
    if source == "stereo":
        return [*lines, f"In {rest.mean():.0%} fewer agree; {np.mean(confidence == 0):.0%} have no depth."]
    lines.append(
        f"{rest.mean():.0%} have depth of {other_source(source)} alone, trusted {_mean(confidence[rest]):.0%}."
    )
    lines.append(f"{np.mean(confidence == 0):.0%} have no depth but what training finds from the photos.")
    return lines


def _mean(values: np.ndarray) -> float:
    return float(values.mean()) if len(values) else 0.0


def _css(color: np.ndarray) -> str:
    return f"rgb({', '.join(str(int(part)) for part in color)})"
