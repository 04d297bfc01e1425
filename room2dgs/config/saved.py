"""A run's saved settings: YAML that holds plain values alone, whoever wrote it.

Text is text: nothing in the file is resolved, tags, anchors and aliases are refused, size and depth are bounded.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import yaml

from room2dgs.errors import InputError
from room2dgs.regular_files import read_regular

LONGEST = 1 << 18  # bytes; a run's own have 6 KiB
MOST_VALUES, DEEPEST = 20_000, 16
MEND = "choose another out=DIR"
# YAML 1.1 takes 1e-5 for a text and 2024-01-31 for a date; OmegaConf, which reads conf/, does neither, so nor do we
FLOAT, DATE = "tag:yaml.org,2002:float", "tag:yaml.org,2002:timestamp"
NUMBER = re.compile(
    r"""^(?: [-+]?[0-9][0-9_]*\.[0-9_]*(?:[eE][-+]?[0-9]+)? | [-+]?[0-9][0-9_]*[eE][-+]?[0-9]+
    | [-+]?\.[0-9][0-9_]*(?:[eE][-+]?[0-9]+)? | [-+]?\.(?:inf|Inf|INF) | \.(?:nan|NaN|NAN) )$""",
    re.X,
)


class _Loader(yaml.SafeLoader):
    """Of what OmegaConf writes."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        names = [key.value for key, _ in node.value]
        if len(set(map(str, names))) < len(names):
            twice = next(name for name in names if names.count(name) > 1)
            raise yaml.constructor.ConstructorError(None, None, f"{twice} comes twice", node.start_mark)
        return super().construct_mapping(node, deep)


class _Dumper(yaml.SafeDumper):
    """Quotes what `_Loader` would take for anything but text."""

    def ignore_aliases(self, data: Any) -> bool:
        return True


for _kind, _others in ((_Loader, (FLOAT, DATE)), (_Dumper, (FLOAT,))):
    _kind.yaml_implicit_resolvers = {
        first: [(tag, pattern) for tag, pattern in known if tag not in _others]
        for first, known in _kind.yaml_implicit_resolvers.items()
    }
    _kind.add_implicit_resolver(FLOAT, NUMBER, list("-+0123456789."))


def as_yaml(values: dict[str, Any]) -> str:
    """What `read_saved` reads back equal, any text included."""
    return yaml.dump(values, Dumper=_Dumper, default_flow_style=False, allow_unicode=True, sort_keys=False)


def read_saved(path: Path) -> dict[str, Any]:
    """The settings in a run's config.yaml, by group.

    Raises:
        InputError: no regular file, too large, or not YAML that holds settings.
    """
    raw = read_regular(path, LONGEST, MEND)
    try:
        text = raw.decode("utf-8-sig")
        refused = _refused(text)
        found = None if refused else yaml.load(text, _Loader)  # a safe loader, and without tags and aliases
    except UnicodeDecodeError as error:
        raise no_configuration(path, "it is not UTF-8 text") from error
    except yaml.MarkedYAMLError as error:
        line = f", line {error.problem_mark.line + 1}" if error.problem_mark else ""
        raise no_configuration(path, f"{error.problem or error.context}{line}") from error
    except (yaml.YAMLError, ValueError, ArithmeticError, LookupError, TypeError, AttributeError) as error:
        raise no_configuration(path, "it is no YAML") from error
    if not isinstance(found, dict) or not found:
        raise no_configuration(path, refused)
    return found


def no_configuration(path: Path, why: str = "") -> InputError:
    """The sentence for a file that holds no settings."""
    return InputError(f"{path} is not the configuration of a run{f' ({why})' if why else ''}; {MEND}")


def _refused(text: str) -> str:
    """Why nobody should build what the text says, or an empty string; stops at the first such thing."""
    depth = 0
    for values, event in enumerate(yaml.parse(text, _Loader)):
        if isinstance(event, yaml.AliasEvent) or getattr(event, "anchor", None):
            return f"it holds a YAML anchor or alias, line {event.start_mark.line + 1}"
        if getattr(event, "tag", None):
            return f"it holds a YAML tag, line {event.start_mark.line + 1}"
        if isinstance(event, yaml.CollectionStartEvent):
            depth += 1
        elif isinstance(event, yaml.CollectionEndEvent):
            depth -= 1
        if depth > DEEPEST:
            return f"it is nested more than {DEEPEST} deep"
        if values > MOST_VALUES:
            return "it holds far more values than there are settings"
    return ""
