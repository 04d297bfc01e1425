"""Matches Metashape's labels to photos: they may lack suffix or folder, and may repeat."""

from __future__ import annotations

from pathlib import Path, PurePosixPath

from room2dgs.captures.listing import PHOTO_SUFFIXES, listed, natural
from room2dgs.captures.photo_names import in_folder

FOLDERS = ("images", "photos", "rgb", ".")


class LabelledPhotos:
    """The photos in and below the first of the usual folders that has some; of the capture's own, those in it alone.

    Attributes:
        folder: that they lie in.
        names: relative to it.
    """

    def __init__(self, root: Path) -> None:
        for name in FOLDERS:
            self.folder = root / name
            files = listed(self.folder) if name == "." else in_folder(self.folder) if self.folder.is_dir() else ()
            self.names = natural(name for name in files if name.lower().endswith(PHOTO_SUFFIXES))
            if self.names:
                break
        self._by_key: dict[str, list[str]] = {}
        for name in self.names:
            path = PurePosixPath(name)
            for key in dict.fromkeys((name, str(path.with_suffix("")), path.name, path.stem)):
                self._by_key.setdefault(key, []).append(name)

    def of(self, label: str, photo: str | None = None) -> list[str]:
        """Names of the photos that a camera may mean; one where it is clear.

        Args:
            photo: the path that it had in the project, whose folders tell photos of one name apart.
        """
        label = label.replace("\\", "/")
        wanted = PurePosixPath((photo or label).replace("\\", "/"))
        found = self._by_key.get(label) or self._by_key.get(str(wanted)) or self._by_key.get(wanted.name)
        found = found or self._by_key.get(PurePosixPath(label).stem) or self._by_key.get(wanted.stem) or []
        exact = [name for name in found if name == label]
        if len(found) > 1 and len(exact) == 1:
            return exact
        if len(found) > 1 and photo:
            shared = {name: _common_end(PurePosixPath(name), wanted) for name in found}
            best = max(shared.values())
            found = [name for name in found if shared[name] == best and best > 0]
        return found

    def called(self, label: str) -> str:
        """What the file of a photo would be called that is not there."""
        suffix = PurePosixPath(self.names[0]).suffix if self.names else ".jpg"
        return label if label.lower().endswith(PHOTO_SUFFIXES) else f"{label}{suffix}"


def _common_end(one: PurePosixPath, other: PurePosixPath) -> int:
    """How many parts at the ends of two paths are the same; of the last its ending does not count."""
    pairs = list(zip(reversed(one.with_suffix("").parts), reversed(other.with_suffix("").parts), strict=False))
    return next((count for count, (a, b) in enumerate(pairs) if a != b), len(pairs))
