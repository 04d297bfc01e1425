"""The lists of named things: each entry is what it says."""

from __future__ import annotations

import importlib
import pkgutil

import pytest

from room2dgs import registries
from room2dgs.errors import InputError
from room2dgs.pipeline.export import chosen_formats, write_formats
from room2dgs.registries.exporters import needs_of
from room2dgs.registry import Registry


def all_registries() -> list[Registry]:
    modules = (
        importlib.import_module(f"room2dgs.registries.{one.name}") for one in pkgutil.iter_modules(registries.__path__)
    )
    return [found for module in modules for found in vars(module).values() if isinstance(found, Registry)]


ENTRIES = [entry for registry in all_registries() for entry in registry.entries()]


@pytest.mark.parametrize("entry", ENTRIES, ids=lambda entry: f"{entry.kind} {entry.name}")
def test_an_entry_can_be_imported_and_has_one_sentence(entry):
    assert entry.load() is not None
    assert entry.description.endswith(".") and "\n" not in entry.description


def test_there_is_a_list_of_each_kind():
    kinds = {registry.kind for registry in all_registries()}
    assert kinds == {
        "layout", "protocol", "format", "mesher", "strategy", "decoder", "primitive", "depth source", "loss",
    }  # fmt: skip
    assert all(len(registry) for registry in all_registries())


def test_an_installed_packages_exporter_writes_beside_ours(installed, tmp_path):
    text = "def write_mine(source, path):\n    path.write_text(f'of {source}')\n    return [path]\n"
    installed("our_exporter", text, "[room2dgs.exporters]\nmine = our_exporter:write_mine\n")
    formats = chosen_formats(["mine"])
    assert formats[0].package == "our_exporter" and not needs_of(formats[0])
    lines: list[str] = []
    written = write_formats("a run", formats, tmp_path, lines.append)
    assert written == [tmp_path / "mine"] and written[0].read_text() == "of a run"
    assert len(lines) == 1 and lines[0].startswith("mine")


def test_a_format_that_no_package_brings_is_told_with_all_names():
    with pytest.raises(InputError, match=r"'mine'.*choose one or more from splats, .*, all"):
        chosen_formats(["glb", "mine"])
