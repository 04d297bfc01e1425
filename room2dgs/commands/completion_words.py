"""What may follow `room2dgs`: commands, their own arguments, settings, and the values that are known."""

from __future__ import annotations

from dataclasses import dataclass

from room2dgs.commands.bench import BENCHES
from room2dgs.commands.verbs import VERBS
from room2dgs.config import conf_dir
from room2dgs.config.keys import leaf_keys
from room2dgs.config.overrides import group_choices
from room2dgs.registries.exporters import EXPORTERS
from room2dgs.registries.protocols import MESH, PROTOCOLS, against

UPS = next(key.choices for key in leaf_keys() if key.name == "export.up")
LAUNCHERS = ("basic", "joblib", "submitit_local", "submitit_slurm", "ray")
ANY: tuple[str, ...] = ()  # a number, a file or a text
# verb -> arguments that are no settings, with their values
OWN: dict[str, dict[str, tuple[str, ...]]] = {
    "app": {"out": ANY, "port": ANY, "browser": ("true", "false")},
    "prepare": {"video": ANY, "images": ANY},
    "run": {"video": ANY, "images": ANY, "log": ("full", "line"), "hydra/launcher": LAUNCHERS},
    "ablate": {"hydra/launcher": LAUNCHERS},
    "depth": {"fill": ("true", "false")},
    "eval": {"run": ANY, "pred": ANY, "gt": ANY, "scene": ANY},
    "mesh": {"run": ANY},
    "render": {
        "run": ANY, "views": ("test", "train", "all"), "path": ("smooth",), "to": ANY,
        "save": ("color", "depth", "depth_npy", "normals", "video"), "frames": ANY, "through": ANY, "fps": ANY,
        "width": ANY,
    },
    "view": {"run": ANY, "host": ANY, "port": ANY, "fps": ANY},
    "report": {"run": ANY},
    "open": {"run": ANY},
    "compare": {"to": ANY},
    "export": {"run": ANY, "to": ANY, "up": UPS, "faces": ANY, "max_error_m": ANY},
    "plan": {"run": ANY, "up": UPS, "to": ("shell", "ifc")},
    "measure": {"run": ANY, "up": UPS, "scale_sigma": ANY, "to": ANY},
    "scale": {"run": ANY, "up": UPS, "length": ANY},
    "table": {"meshes": ANY, "protocol": tuple(against(MESH, PROTOCOLS.names())), "name": ANY, "out": ANY},
    "bench": {
        "out": ANY, "in_run": ("true", "false"), "scenes": ANY, "root": ANY, "to": ANY,
        "methods": ANY, "seconds": ANY, "other": ANY,
    },
}  # fmt: skip
WITHOUT_SETTINGS = ("table", "open", "compare", "app", "doctor", "completion", "bench")


@dataclass(frozen=True)
class Words:
    """What is completed.

    Attributes:
        verbs: command -> its line in the help.
        second: verb -> what may stand behind it alone, such as the benchmarks' names.
        own: verb -> arguments of its own, without "=".
        settings: keys that all verbs but those in `WITHOUT_SETTINGS` take.
        values: (verb, key) -> values; verb "" stands for all.
    """

    verbs: dict[str, str]
    second: dict[str, tuple[str, ...]]
    own: dict[str, tuple[str, ...]]
    settings: tuple[str, ...]
    values: dict[tuple[str, str], tuple[str, ...]]


def found_words() -> Words:
    """Of this version."""
    from room2dgs.commands.completion_scripts import SCRIPTS

    groups = {name: tuple(choices) for name, choices in group_choices(conf_dir()).items() if len(choices) > 1}
    values = {("", key.name): key.choices for key in leaf_keys() if key.choices}
    values |= {("", name): choices for name, choices in groups.items()}
    values |= {(verb, key): choices for verb, own in OWN.items() for key, choices in own.items() if choices}
    values[("export", "to")] = (*EXPORTERS, "all")
    return Words(
        verbs=VERBS,
        second={"bench": tuple(BENCHES), "completion": tuple(SCRIPTS)},
        own={verb: tuple(OWN.get(verb, ())) for verb in VERBS},
        settings=(*(key.name for key in leaf_keys()), *groups),
        values=values,
    )
