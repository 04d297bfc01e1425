"""`room2dgs measure`: lengths in an earlier run, with their standard deviations."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from room2dgs.commands.own_arguments import own_arguments
from room2dgs.commands.settings_help import asked_for_help, filled
from room2dgs.commands.short_keys import with_full_keys
from room2dgs.config.keys import leaf_keys
from room2dgs.errors import InputError
from room2dgs.files import whole_file
from room2dgs.lengths.targets import Target, target_of
from room2dgs.pipeline.measure import MeasuredRun, measured_run
from room2dgs.runs.folder import earlier_run, last_value

USAGE = "room2dgs measure RUN [ONE OTHER | height] [scale_sigma=0.005] [to=FILE] [up=auto|x|y|z|-x|-y|-z]"


def main(argv: list[str]) -> int:
    """Measure in an earlier run, and print JSON: value, one standard deviation, its parts, and what it rests on.

    ONE and OTHER are X,Y,Z in metres of mesh.ply's world, PHOTO:COLUMN,ROW of a photo as the run works with it, plane@
    and one of these for the plane around it, or floor, ceiling, wall_1, ... of the plan. Two points are measured
    straight, all else square to the planes; planes that are not parallel give their angle. Without them come the
    dimensions of all rooms; height is that from floor to ceiling. The deviation has three parts: surface (the expected
    error of the mesh there), fit (how uneven it lies about a plane) and scale. scale_sigma= says how sure poses are
    that were given as metres; to= writes a file as well.
    """
    if asked_for_help(argv):
        print(f"{USAGE}\n\n{filled(main.__doc__ or '')}")
        return 0
    if not last_value(argv, "run"):
        raise InputError("run is not given; add run=DIR, the folder of an earlier run")
    own, rest = own_arguments(argv, ("run", "scale_sigma", "to"))
    settings = [text for text in rest if text.partition("=")[0] in _SETTINGS]
    words = [text for text in rest if text not in settings]
    if words not in ([], ["height"]) and len(words) != 2:
        raise InputError(f"{len(words)} ends of a length are given ({' '.join(words)}); give two, height, or none")
    targets = [target_of(text) for text in words] if len(words) == 2 else []
    config = earlier_run([*with_full_keys(settings, {"up": "export.up"}), f"out={own['run']}"])
    run = measured_run(config, _silent, _share(own.get("scale_sigma")))
    found = _between(run, *targets) if targets else _dimensions(run, only_height=bool(words))
    text = json.dumps(found, indent=1, ensure_ascii=False)
    print(text)
    if "to" in own:
        to = Path(own["to"]).expanduser()
        try:
            with whole_file(to) as temporary:
                temporary.write_text(text + "\n", encoding="utf-8")
        except OSError as error:
            raise InputError(f"{to} cannot be written ({error.strerror}); choose another to=FILE") from error
    return 0


_SETTINGS = {"up", *(key.name for key in leaf_keys())}


def _between(run: MeasuredRun, one: Target, other: Target) -> dict[str, Any]:
    from room2dgs.lengths.between import PARALLEL_DEG, angle_deg

    about = {"from": one.text, "to": other.text, "scale": run.scale.words}
    if one.plane and other.plane:
        angle = angle_deg(run.plane(one), run.plane(other))
        if angle > PARALLEL_DEG:
            return {"value": angle, "unit": "degrees", "rests_on": f"{one.text} and {other.text}", **about}
    return {**run.between(one, other).as_dict(run.scale.unit), **about}


def _dimensions(run: MeasuredRun, only_height: bool) -> dict[str, Any]:
    from room2dgs.plan.dimensions import dimensions

    if not only_height:
        return dimensions(run.plan, run.scale)
    if run.plan.height is None:
        raise InputError("no level ceiling was seen, so there is no height; measure from a point")
    return {**run.plan.height.as_dict(run.scale.unit), "scale": run.scale.words}


def _silent(line: str) -> None:
    """The standard output has JSON alone."""


def _share(text: str | None) -> float | None:
    if text is None:
        return None
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0 <= value < 1:
        raise InputError(f"scale_sigma={text} is no relative deviation; give for example 0.005")
    return value
