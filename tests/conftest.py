"""Shared by all tests."""

from __future__ import annotations

import os

from hypothesis import settings

# CI must not turn red by the luck of the draw; at home hypothesis goes on searching
settings.register_profile("ci", derandomize=True)
if os.environ.get("CI"):
    settings.load_profile("ci")
