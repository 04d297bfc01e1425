"""Names that no file system takes are refused, not asked for."""

from pathlib import Path

import pytest

from room2dgs.captures.listing import inside
from room2dgs.errors import InputError


@pytest.mark.parametrize("name", ["9" * 300, "é" * 130, "/".join(["a"] * 3000)])
def test_a_name_too_long_for_a_file_is_told(name, tmp_path: Path):
    with pytest.raises(InputError, match="too long"):
        inside(tmp_path, name, "transforms.json")
    assert inside(tmp_path, "a" * 200, "transforms.json") == tmp_path / ("a" * 200)
