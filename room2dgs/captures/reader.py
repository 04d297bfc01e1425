"""The interface of a reader of captures."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from room2dgs.captures.capture import Capture
from room2dgs.captures.listing import Listing
from room2dgs.config import SceneConfig


class Reader(NamedTuple):
    """Reads one layout of captures; `room2dgs.registries.readers` lists all of them by name.

    A reader says where photos, poses and depth are and what their numbers mean. Choosing frames, undistorting,
    resizing and checking come after it, the same for all layouts.

    Attributes:
        recognise: whether the names of a folder's files look like the layout; it opens no photo. It is asked about
            every folder whose layout is not given, so it must be quick and never fail.
        read: the capture at a path, by the settings of the group `scene`; raises InputError, whose sentence names the
            file, where the capture is damaged as a whole. What costs a single frame goes into its `Shot.pose` or into
            `Capture.warnings`.
        needs: which files the layout has, for error messages ("color/, pose/ and intrinsic/").
        contains: names of layouts that folders of this one look like too, because they contain their files.
    """

    recognise: Callable[[Listing], bool]
    read: Callable[[Path, SceneConfig], Capture]
    needs: str
    contains: tuple[str, ...] = ()
