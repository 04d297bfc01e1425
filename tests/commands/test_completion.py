"""What TAB offers, asked of the shells themselves; and that every example of the help would be understood."""

from __future__ import annotations

import ast
import importlib
import re
import shlex
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from types import ModuleType

import pytest

from room2dgs import cli
from room2dgs.commands.bench import BENCHES
from room2dgs.commands.completion_words import OWN, WITHOUT_SETTINGS
from room2dgs.commands.examples import EXAMPLES
from room2dgs.commands.verbs import VERBS
from room2dgs.config import conf_dir
from room2dgs.config.overrides import group_choices, known_key
from room2dgs.study.launch import of_hydra

TYPED = {
    "room2dgs ru": ["run"],
    "room2dgs run train.vi": ["train.viewer="],
    "room2dgs run scene.la": ["scene.layout="],
    "room2dgs run scene.layout=po": ["polycam"],
    "room2dgs run train.viewer=": ["true", "false"],
    "room2dgs export to=glb,sp": ["glb,splats", "glb,splats_2dgs", "glb,splat", "glb,spz"],
    "room2dgs export up=-": ["-x", "-y", "-z"],
    "room2dgs bench sui": ["suite"],
    "room2dgs depth fi": ["fill="],
    "room2dgs depth fill=": ["true", "false"],
    "room2dgs bench suite sce": ["scenes="],
    "room2dgs table me": ["meshes="],  # and no setting: this command has none
    "room2dgs run strat": ["strategy.", "strategy="],
}
READERS = ("own_arguments", "choices", "whole_number", "last_value")  # their second argument names one, or several


def script(shell: str, folder: Path, capsys) -> Path:
    assert cli.main(["completion", shell]) == 0
    path = folder / f"room2dgs.{shell}"
    path.write_text(capsys.readouterr().out)
    return path


def said(*command: str) -> list[str]:
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True)
    assert not done.stderr
    return done.stdout.splitlines()


def test_bash_offers_commands_keys_and_values(tmp_path, capsys):
    asked = "".join(f"ask {shlex.quote(line)}\n" for line in TYPED)
    (tmp_path / "ask").write_text(f"""source {script("bash", tmp_path, capsys)}
ask() {{ COMP_LINE=$1 COMP_POINT=${{#1}}; _room2dgs; echo "${{COMPREPLY[*]}}"; }}
COMP_WORDBREAKS="=:"
{asked}COMP_WORDBREAKS=" "
ask "room2dgs run scene.layout=po"
""")
    *offered, unbroken = said("bash", str(tmp_path / "ask"))
    for line, words in zip(TYPED, offered, strict=True):
        assert sorted(words.split()) == sorted(TYPED[line]), line
    assert unbroken == "scene.layout=polycam"


@pytest.mark.skipif(not shutil.which("fish"), reason="no fish here")
def test_fish_offers_the_same(tmp_path, capsys):
    path = script("fish", tmp_path, capsys)
    asked = "; ".join(f"complete -C {shlex.quote(line)}; echo ." for line in TYPED)
    answers = "\n".join(said("fish", "-c", f"source {path}; {asked}")).split("\n.")
    for (line, expected), answer in zip(TYPED.items(), answers, strict=False):
        key = line.rpartition(" ")[2].partition("=")[0] + "=" if "=" in line else ""
        assert sorted(row.partition("\t")[0] for row in answer.split("\n") if row) == sorted(
            key + one for one in expected
        )


@pytest.mark.skipif(not shutil.which("zsh"), reason="no zsh here")
def test_zsh_can_read_its_script(tmp_path, capsys):
    assert said("zsh", "-n", str(script("zsh", tmp_path, capsys))) == []


def test_another_shell_is_told(capsys):
    assert cli.main(["completion", "csh"]) == 2
    assert "bash|zsh|fish" in capsys.readouterr().err


def test_every_command_has_an_example_and_every_key_in_one_is_known():
    groups = group_choices(conf_dir())
    assert set(cli.VERBS) <= set(EXAMPLES) <= set(cli.VERBS) | {f"bench {name}" for name in BENCHES}
    for command, lines in EXAMPLES.items():
        verb = command.partition(" ")[0]
        for typed, _ in lines:
            for word in shlex.split(typed.partition(" > ")[0]):
                key = word.partition("=")[0]
                if "=" in word and key not in OWN.get(verb, ()) and not of_hydra(word) and verb not in WITHOUT_SETTINGS:
                    assert known_key(word, groups) == key, f"{command} {typed}"


@pytest.mark.parametrize(
    "argv", [["mesh", "--help"], ["export", "-h"], ["bench", "raster", "--help"], ["plan", "--help"]]
)
def test_help_ends_with_examples(argv, capsys):
    with suppress(SystemExit):  # argparse's way to end
        assert cli.main(argv) == 0
    *_, told = capsys.readouterr().out.partition("\nExamples:\n")
    command = " ".join(argv[:-1])
    typed = [line for line in told.splitlines() if not line.startswith("      ")]  # else a comment below its line
    assert all(line.startswith(f"  room2dgs {command} ") for line in typed) and typed


def sources() -> Iterator[tuple[str, ModuleType]]:
    """(verb, module) of every command, of its benchmarks, and of what else reads its arguments."""
    for verb in VERBS:
        yield verb, importlib.import_module(f"room2dgs.commands.{verb}")
    for bench, _ in BENCHES.values():
        yield "bench", importlib.import_module(bench)


def read_by(module: ModuleType) -> set[str]:
    """Names of arguments that a module reads: in its lists of them, and in its calls."""
    found = {name for one in ("OWN", "SHORT", "FOOTAGE") for name in getattr(module, one, ())}
    for node in ast.walk(ast.parse(Path(module.__file__).read_text(encoding="utf-8"))):
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") in READERS:
            found |= {one.value for one in ast.walk(node.args[1]) if isinstance(one, ast.Constant)}
    return found


@pytest.mark.parametrize(("verb", "module"), [pytest.param(*one, id=one[1].__name__) for one in sources()])
def test_every_argument_of_a_commands_own_is_offered(verb, module):
    """Those that its code reads, and those that its usage names, with the values that the usage lists."""
    usage = getattr(module, "USAGE", "")
    groups = group_choices(conf_dir())
    named = set(re.findall(r"[^\w./]([a-z_]+)=", usage))
    own = {name for name in named | read_by(module) if name not in groups and not known_setting(name)}
    assert own <= set(OWN.get(verb, ())), own - set(OWN.get(verb, ()))
    for key, values in re.findall(r"[^\w./]([a-z_]+)=([\w-]+(?:\|[\w-]+)+)(?=[\] \n]|$)", usage):
        if key in own and values.islower():
            assert set(values.split("|")) <= set(OWN[verb][key]), key


def known_setting(name: str) -> bool:
    """As `out` and `resume` are, and what stands for a setting with dots."""
    return name in ("out", "resume") or "." in name


def test_own_arguments_are_in_the_usage():
    for verb, own in OWN.items():
        usage = " ".join(getattr(module, "USAGE", "") for name, module in sources() if name == verb)
        for key in set(own) - {"run", "hydra/launcher"}:
            assert f"{key}=" in usage, f"{verb} {key}"
