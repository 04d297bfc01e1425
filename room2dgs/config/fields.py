"""What a field of the settings may hold, where pydantic's own types do not say it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from pydantic import AfterValidator, ConfigDict, Field, Strict

# No key but the fields', and neither NaN nor infinity in a number.
GROUP = ConfigDict(extra="forbid", allow_inf_nan=False, coerce_numbers_to_str=True)


@dataclass(frozen=True)
class Wants:
    """Says in words what a field takes, where its type and bounds do not."""

    words: str


@dataclass(frozen=True)
class IsPath:
    """Marks a file or folder: its value on the command line is taken as it stands."""


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
