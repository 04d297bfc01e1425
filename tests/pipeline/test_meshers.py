"""The list of meshers is the only one, and each entry says what it needs."""

from __future__ import annotations

import inspect
from pathlib import Path

import pytest

from room2dgs.commands.run import main as run
from room2dgs.config import load_config
from room2dgs.config.keys import leaf_keys
from room2dgs.errors import InputError
from room2dgs.pipeline import meshers
from room2dgs.pipeline.meshers.mesher import Mesher
from room2dgs.registries.meshers import MESHERS

GIVEN = ("scene.path=x", "out=y")


def test_each_file_of_meshers_is_in_the_registry():
    files = {path.stem for path in Path(meshers.__path__[0]).glob("*.py")} - {"__init__", "mesher"}
    assert files == set(MESHERS.names())
    facts, wanted = set(MESHERS.get("surfels").facts), list(inspect.signature(Mesher.__call__).parameters)[1:]
    for entry in MESHERS.entries():
        assert list(inspect.signature(entry.load()).parameters) == wanted
        assert set(entry.facts) == facts and entry.description.endswith(".")


def test_settings_help_and_sentences_have_the_registrys_names(capsys):
    (key,) = (one for one in leaf_keys() if one.name == "mesh.source")
    assert key.choices == MESHERS.names()
    assert run(["--help"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    for entry in MESHERS.entries():
        assert f"{entry.name}: {entry.description}" in said
    with pytest.raises(InputError, match=f"choose from {', '.join(MESHERS.names())}"):
        load_config([*GIVEN, "mesh.source=pillows"])


def test_facts_decide_what_a_run_does():
    assert {name: load_config([*GIVEN, f"mesh.source={name}"]).mesh.of_surfels for name in MESHERS.names()} == {
        "surfels": True,
        "depth": False,
        "stereo": False,
        "points": False,
    }
    with_priors = {name for name in MESHERS if load_config([*GIVEN, f"mesh.source={name}"]).mesh.with_priors}
    assert with_priors == {"surfels", "depth"}
    with pytest.raises(InputError, match=r"stereo is nothing without stereo; .* or mesh\.source=depth or points"):
        load_config([*GIVEN, "mesh.source=stereo", "stereo.enabled=false"])
