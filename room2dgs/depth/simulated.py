"""Whether maps were made from ground truth; whatever uses them must say so."""

from __future__ import annotations

import json
from pathlib import Path

LABEL = "priors.json"


def simulated(folder: Path) -> bool:
    """Whether priors.json in the maps' folder or in the one above says that they are simulated."""
    for parent in (folder, folder.resolve().parent):
        try:
            label = json.loads((parent / LABEL).read_text(encoding="utf-8"))
        except (OSError, ValueError):
            continue
        if isinstance(label, dict) and label.get("simulated") is True:
            return True
    return False
