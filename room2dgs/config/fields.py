"""How a field of the settings is declared: default, bounds, sentence, and whether everybody is shown it."""

from __future__ import annotations

import copy
import difflib
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Annotated, Any

from pydantic import AfterValidator, ConfigDict, Field, Strict
from pydantic_core import core_schema

# No key but the fields', and neither NaN nor infinity in a number.
GROUP = ConfigDict(extra="forbid", allow_inf_nan=False, coerce_numbers_to_str=True)
REQUIRED = ...  # the default of a setting that the user must give


@dataclass(frozen=True)
class Wants:
    """Says in words what a field takes, where its type and bounds do not."""

    words: str


@dataclass(frozen=True)
class IsPath:
    """Marks a file or folder: its value on the command line is taken as it stands."""


@dataclass(frozen=True)
class Name:
    """Marks a text that must be one of the names of a registry, whose modules are not imported for it.

    Attributes:
        known: gives the names; it is asked when a value is checked, since installed packages add to registries.
    """

    known: Callable[[], tuple[str, ...]]

    def __get_pydantic_core_schema__(self, source: Any, handler: Callable[[Any], Any]) -> Any:
        return core_schema.no_info_after_validator_function(self._checked, handler(source))

    def _checked(self, name: str) -> str:
        names = self.known()
        if name not in names:
            near = difflib.get_close_matches(name, names, n=1)
            guess = f" (did you mean {near[0]}?)" if near else ""
            raise ValueError(f"{{key}}={name} is not known{guess}; choose from {', '.join(names)}")
        return name


def public(default: Any, description: str, **bounds: Any) -> Any:
    """A setting that every help shows.

    Args:
        default: its value where nobody gives one, or `REQUIRED`.
        description: a sentence that stands alone. "{term}" in it becomes what `group` calls the settings it belongs to.
        bounds: pydantic's ("ge", "le", "min_length", ...).
    """
    return _field(default, description, True, bounds)


def expert(default: Any, description: str, **bounds: Any) -> Any:
    """A setting that `--help all` shows, and the documentation; see `public`."""
    return _field(default, description, False, bounds)


def group(kind: type, called: str = "", **defaults: Any) -> Any:
    """Settings of their own below a field.

    Args:
        kind: their dataclass.
        called: what stands for "{term}" in their descriptions.
        defaults: those that differ from the dataclass's own.
    """
    return Field(default_factory=partial(kind, **defaults), json_schema_extra={"called": called})


def _field(default: Any, description: str, is_public: bool, bounds: dict[str, Any]) -> Any:
    marks: dict[str, Any] = {"public": is_public}
    if isinstance(default, list):
        return Field(
            default_factory=partial(copy.deepcopy, default), description=description, json_schema_extra=marks, **bounds
        )
    return Field(default=default, description=description, json_schema_extra=marks, **bounds)


def _not_blank(text: str) -> str:
    if not text.strip():
        raise ValueError("{key} is empty; give {key}=DIR")
    return text


def _share_or_iteration(value: int | float) -> int | float:
    """An int as it is, a float above 0 as a share; 0.0 is iteration 0."""
    if isinstance(value, float) and value > 1:
        raise ValueError(f"{{key}}={value} is impossible; give {TIME} or {SHARE}")
    return value or 0


TIME, SHARE = "a whole number of iterations", "a share of train.iterations from 0.0 to 1.0"

Int = Annotated[int, Strict()]  # 2.0 and true are none
Float = Annotated[float, Strict()]
PathText = Annotated[str, IsPath()]
Folder = Annotated[str, AfterValidator(_not_blank), IsPath()]
# `1` is iteration 1, `1.0` all of them.
Time = Annotated[Int | Float, Field(ge=0), AfterValidator(_share_or_iteration), Wants(f"{TIME} or {SHARE}")]
