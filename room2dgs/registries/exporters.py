"""The formats of `room2dgs export`, in the order in which help and documentation show them.

Another package brings a format by an entry point of the group "room2dgs.exporters", whose name is the format's.
"""

from __future__ import annotations

from typing import Any

from room2dgs.registry import Registry

EXPORTERS: Registry[Any] = Registry("format", "room2dgs.exporters")
