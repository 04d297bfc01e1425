"""What the tools' command lines have in common."""

from __future__ import annotations

import argparse
from dataclasses import dataclass

import pytest

from room2dgs.commands.flags import add_flags
from room2dgs.errors import InputError, RunFailed
from room2dgs.tools.command_line import command_line


@dataclass
class Options:
    many_rooms: int = 3
    share: float = 0.5
    bare: bool = False


def ending(error: type[BaseException] | None) -> int:
    @command_line("measure")
    def main(arguments: list[str] | None = None) -> None:
        if error:
            raise error("no depth; add some")

    return main([])


@pytest.mark.parametrize(("error", "code"), [(None, 0), (InputError, 2), (KeyboardInterrupt, 130)])
def test_the_exit_code_says_how_it_ended(error, code):
    assert ending(error) == code


def test_bad_input_is_told_in_one_line(capsys):
    ending(InputError)
    assert capsys.readouterr() == ("", "measure: no depth; add some\n")


def test_a_tool_has_exit_codes_of_its_own_and_those_of_failed_runs(capsys):
    assert command_line("judge")(len)(["a", "b", "c"]) == 3

    @command_line("study")
    def failing(arguments: list[str]) -> None:
        raise RunFailed("the first run of three has no photos", 7)

    assert failing([]) == 7
    assert capsys.readouterr().err == "study: a run failed: the first run of three has no photos\n"


def test_faults_are_not_hidden():
    with pytest.raises(ZeroDivisionError):
        ending(ZeroDivisionError)


def test_fields_become_flags_of_their_defaults_types():
    parser = argparse.ArgumentParser()
    add_flags(parser, Options, dict.fromkeys(("many_rooms", "share", "bare"), "so many"))
    assert vars(parser.parse_args([])) == {"many_rooms": 3, "share": 0.5, "bare": False}
    given = vars(parser.parse_args(["--many-rooms", "7", "--share", "1", "--bare"]))
    assert given == {"many_rooms": 7, "share": 1.0, "bare": True} and isinstance(given["share"], float)
