"""What is optimised and rendered."""

from __future__ import annotations

from typing import Any

from room2dgs.registry import Registry

PRIMITIVES: Registry[Any] = Registry("primitive")
