"""Warns of files beside the photos whose format is not read."""

from __future__ import annotations

from room2dgs.captures.capture import Capture
from room2dgs.captures.listing import unread_photos

MOST_FOLDERS = 1000  # that are looked into


def warn_passed_over(capture: Capture) -> None:
    """Add to a capture's warnings what its folders of photos hold that is not read."""
    folders = dict.fromkeys(shot.path.parent for shot in capture.shots if shot.photo is None)
    for folder in list(folders)[:MOST_FOLDERS]:
        message = unread_photos(folder)
        if message:
            capture.warnings.append(message)
