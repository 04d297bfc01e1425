"""Where prior depth comes from: the values of `prior.depth.source`."""

from __future__ import annotations

from typing import Any

from room2dgs.registry import Registry

DEPTH_SOURCES: Registry[Any] = Registry("depth source")
