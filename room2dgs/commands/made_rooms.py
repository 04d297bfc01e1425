"""What benchmarks of runs of made rooms begin and end with."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from room2dgs.commands.own_arguments import own_arguments
from room2dgs.errors import InputError
from room2dgs.files import whole_file
from room2dgs.report.table import Table, terminal
from room2dgs.runs.folder import earlier_run

if TYPE_CHECKING:
    from room2dgs.bench.plan_truth import PlanTruth
    from room2dgs.pipeline.measure import MeasuredRun


def given_rooms(argv: list[str]) -> tuple[Iterator[tuple[str, PlanTruth, MeasuredRun]], Path | None]:
    """Name, truth and measured run of each folder that is given, one at a time; and the file that to= names.

    Raises:
        InputError: no folder is given; later, one that holds no run of a made room.
    """
    own, folders = own_arguments(argv, ("to",))
    if not folders:
        raise InputError("no run is given; name the folders of runs of made rooms")
    return _measured(folders), Path(own["to"]).expanduser() if "to" in own else None


def print_tables(tables: Sequence[Table], values: Any, to: Path | None) -> None:
    """For a person, and as JSON where a file is given."""
    for one in tables:
        print(terminal(one))
    if to is not None:
        with whole_file(to) as temporary:
            temporary.write_text(json.dumps(values, indent=1) + "\n", encoding="utf-8")


def _measured(folders: Sequence[str]) -> Iterator[tuple[str, PlanTruth, MeasuredRun]]:
    from room2dgs.bench.lengths import truth_of
    from room2dgs.pipeline.measure import measured_run

    for folder in folders:
        config = earlier_run([f"out={folder}", "export.up=z"])
        truth = truth_of(config)
        yield Path(config.scene.path).name, truth, measured_run(config, print, 0.0)
