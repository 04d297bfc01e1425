"""Every command and setting that a page shows exists: verbs, settings and their values, tools, make targets."""

from __future__ import annotations

import contextlib
import importlib.util
import io
import re
import shlex
from functools import lru_cache

import pytest

from room2dgs import cli
from room2dgs.commands.bench import BENCHES
from room2dgs.commands.verbs import VERBS
from room2dgs.config import conf_dir, load_config
from room2dgs.config.keys import leaf_keys
from room2dgs.config.overrides import group_choices
from room2dgs.errors import InputError
from tests.docs.pages import ROOT, commands, inline, name_of, pages

COMMANDS = tuple(dict.fromkeys(commands()))
try:
    import tomllib
except ModuleNotFoundError:  # Python 3.10
    from pip._vendor import tomli as tomllib

LAUNCHERS = {"basic", "joblib", "submitit_slurm", "submitit_local", "ray"}
SWEEPS = {"-m", "ablate", "suite"}
GROUPS = tuple(dict.fromkeys(key.name.partition(".")[0] for key in leaf_keys() if "." in key.name))
FILES = re.compile(
    r"\.(json|md|py|ply|html|svg|dxf|npz|npy|csv|yaml|safetensors|txt|png|glb|obj|spz|stl|splat|jpg|xml|log|mp4|cpp|h|cu|onnx|ci)$"
)


def _words(line):
    return shlex.split(line.replace("...", ""))


def _composes(settings, sweeps=False):
    """Raises where a setting or a value is impossible."""
    given = [one for one in settings if not one.startswith(("hydra.", "hydra/"))]
    for launcher in (one.partition("=")[2] for one in settings if one.startswith("hydra/launcher=")):
        assert launcher in LAUNCHERS
    choices = [[one] for one in given]
    if sweeps:
        choices = [_each(one) for one in given]
    for column in range(max(map(len, choices), default=0)):
        chosen = [one[min(column, len(one) - 1)] for one in choices]
        if "prior.depth.model=model.onnx" in chosen:  # whose card lies beside it
            card = "depth_anything_3" if "prior/depth=onnx_multiview" in chosen else "depth_anything_v2"
            chosen.append(f"prior.depth.card={conf_dir() / f'_networks/{card}.json'}")
        load_config(["scene.path=a", "out=b", *chosen])


def _each(setting):
    key, _, value = setting.partition("=")
    return [setting] if value.startswith("[") else [f"{key}={part}" for part in value.split(",")]


@lru_cache
def _help(verb):
    said = io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.suppress(SystemExit):
        cli.main([*verb, "--help"])
    return said.getvalue()


def _check_room2dgs(words):
    verb, *rest = words
    if verb == "VERB":
        return
    assert verb in VERBS, f"there is no verb {verb}"
    name = (verb,)
    if verb == "bench":
        assert rest[0] in BENCHES, f"there is no bench {rest[0]}"
        name, rest = (verb, rest[0]), rest[1:]
    settings = []
    for word in rest:
        key, equals, _ = word.partition("=")
        if word.startswith("-"):
            assert word in ("-m", "--help") or word in _help(name), f"{' '.join(name)} has no option {word}"
        elif (
            equals and ("." in key or "/" in key or key in group_choices(conf_dir())) and f" {key}=" not in _usage(name)
        ):
            settings.append(word)
        elif equals and key not in ("out", "resume"):
            assert f"{key}=" in _help(name), f"{' '.join(name)} knows no {key}="
    sweeps = bool({*words} & SWEEPS)
    _composes([one for one in settings if not one.endswith(("=", "KEY=VALUE"))], sweeps)


def _usage(name):
    return _help(name).split("\n\n")[0]


def _check_tool(module, words):
    assert importlib.util.find_spec(module), f"there is no {module}"
    inner = [word.partition(": ")[2].split() for word in words if word.startswith("point=")]
    outer = [word for word in words if "=" in word and "." in word.partition("=")[0] and not word.startswith("point=")]
    for settings in inner or [[]]:
        _composes([*outer, *settings])


def _check(line):
    for part in re.split(r"\s*(?:&&|>|\||;)\s*", line)[:1]:
        words = _words(part)
        if words[0].endswith("room2dgs"):
            _check_room2dgs(words[1:])
        elif words[:2] == ["python", "-m"]:
            _check_tool(words[2], words[3:]) if words[2] != "room2dgs" else _check_room2dgs(words[3:])
        elif words[0] == "make":
            targets = set(
                re.findall(r"^([a-z][a-z-]*):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
            )
            assert set(words[1:]) <= targets
        elif words[0] == "pip":
            extras = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"][
                "optional-dependencies"
            ]
            for named in re.findall(r"(?:room2dgs|\.)\[([\w,]+)\]", part):
                assert set(named.split(",")) <= set(extras)


@pytest.mark.parametrize(("page", "line"), COMMANDS, ids=[f"{page}: {line[:60]}" for page, line in COMMANDS])
def test_a_shown_command_is_one(page, line):
    _check(line)


def test_the_pages_show_commands():
    assert len(COMMANDS) > 100
    assert {line for _, line in COMMANDS} >= {"make demo", "make test", "room2dgs run video=walk.mp4 out=runs/room"}


@pytest.mark.parametrize("page", pages(), ids=name_of)
def test_settings_in_sentences_exist(page):
    names = {key.name for key in leaf_keys()}
    choices = group_choices(conf_dir())
    for code in inline(page):
        words = code.text.split()
        if all(re.match(r"[a-z_]+([./][\w.]+)*=\S+$", word) for word in words):
            known = [word for word in words if word.partition("=")[0] in names | set(choices)]
            unknown = [word for word in words if word.startswith(tuple(f"{group}." for group in GROUPS))]
            _composes([word for word in dict.fromkeys([*known, *unknown]) if not re.search(r"=[A-Z]+$|\.\.\.", word)])
        elif re.fullmatch(r"[a-z_]+(\.[a-z_0-9]+)+=?", code.text) and not FILES.search(code.text):
            name = code.text.rstrip("=")
            if name.partition(".")[0] in GROUPS:
                assert any(one == name or one.startswith(name + ".") for one in names), f"{name} is no setting"


@pytest.mark.parametrize(
    "line",
    [
        "room2dgs fly out=a", "room2dgs run scene.path=room out=a train.iteration=3", "room2dgs run sorcery=1 out=a",
        "room2dgs run scene.path=room out=a mesh.fill=holse", "room2dgs bench nothing", "make nothing",
        "python -m room2dgs.tools.nothing", "pip install 'room2dgs[nothing]'", "room2dgs doctor --fly",
        "python -m room2dgs.tools.tradeoff room out=a 'point=b: train.iteration=3'",
    ],
)  # fmt: skip
def test_what_does_not_exist_is_seen(line):
    with pytest.raises((AssertionError, InputError)):
        _check(line)
