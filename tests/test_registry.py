"""Registries: the lists of named things, with those of other packages."""

from __future__ import annotations

import subprocess
import sys

import pytest

from room2dgs.errors import InputError
from room2dgs.registry import Registry

GROUP = "room2dgs.test_colours"


@pytest.fixture
def colours():
    registry = Registry("colour", GROUP, ("mix",))
    registry.register("red", "fractions:Fraction", "A warm colour.", warm=True)
    registry.register("blue", "fractions:Fraction.from_float", "A cold colour.", warm=False)
    return registry


def test_entries_keep_their_order_and_are_imported_when_loaded(colours):
    from fractions import Fraction

    assert colours.names() == ("red", "blue") == tuple(colours)
    assert [entry.facts["warm"] for entry in colours.entries()] == [True, False]
    assert colours.get("red").description == "A warm colour."
    assert colours.load("red") is Fraction
    assert colours.load("blue")(0.5) == Fraction(1, 2)


def test_an_unknown_name_is_told_with_the_nearest_one_and_all(colours):
    with pytest.raises(InputError, match=r"^colour 'rad' is not known \(did you mean red\?\); choose from red, blue$"):
        colours.get("rad")
    with pytest.raises(InputError, match=r"^colour 'yellow' is not known; choose from red, blue$"):
        colours.load("yellow")
    assert "rad" not in colours and "red" in colours


def test_a_name_is_registered_once(colours):
    with pytest.raises(ValueError, match="red is registered twice"):
        colours.register("red", "fractions:Fraction", "Again.")


def test_an_installed_packages_entry_follows_ours_and_is_imported_only_when_loaded(colours, installed, tmp_path):
    imported = tmp_path / "imported"
    text = f"open({str(imported)!r}, 'x').close()\nclass Green:\n    mix = 1\n"
    installed("greenery", text, f"[{GROUP}]\ngreen = greenery:Green\n")
    assert colours.names() == ("red", "blue", "green")
    assert colours.get("green").package == "greenery"
    assert not imported.exists()
    assert colours.load("green").mix == 1
    assert imported.exists()


def test_a_broken_entry_point_is_one_sentence_that_names_the_package(colours, installed):
    installed("broken_one", "import nothing_of_this_name", f"[{GROUP}]\ngreen = broken_one:Green\n")
    installed("broken_two", "1 / 0", f"[{GROUP}]\ngrey = broken_two:Grey\n")
    installed("broken_three", "Pink = 3", f"[{GROUP}]\npink = broken_three:Pink\n")
    with pytest.raises(InputError, match=r"colour green of the package broken_one cannot be imported \(ModuleNotFound"):
        colours.load("green")
    with pytest.raises(InputError, match=r"broken_two cannot be imported \(ZeroDivisionError: .*repair or uninstall"):
        colours.load("grey")
    with pytest.raises(InputError, match=r"broken_three has no mix \(broken_three:Pink\); repair or uninstall it"):
        colours.load("pink")


def test_a_taken_name_stays_ours_and_the_other_is_told(colours, installed, logged_warnings):
    installed("crimson", "Red = 1", f"[{GROUP}]\nred = crimson:Red\n")
    assert colours.get("red").package is None
    assert colours.names() == ("red", "blue")
    said = ["warning: colour red of the package crimson is left out: room2dgs has one of this name"]
    assert logged_warnings.messages == said


def test_a_registry_without_a_group_has_its_own_entries_alone(installed):
    installed("greenery", "class Green:\n    mix = 1\n", f"[{GROUP}]\ngreen = greenery:Green\n")
    assert "green" not in Registry("colour") and "green" in Registry("colour", GROUP)


def test_the_lists_need_neither_torch_nor_numpy():
    """Settings, help and completion ask them at once."""
    code = (
        "import pkgutil, sys, importlib, room2dgs.registries as all_of_them\n"
        "for one in pkgutil.iter_modules(all_of_them.__path__):\n"
        "    importlib.import_module(f'room2dgs.registries.{one.name}')\n"
        "print(*{'torch', 'numpy', 'cv2', 'pydantic'} & set(sys.modules))"
    )
    found = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert found.stdout == "\n"
