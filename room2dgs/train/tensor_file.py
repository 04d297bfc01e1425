"""Named tensors with JSON metadata and a checksum in one safetensors file."""

from __future__ import annotations

import json
import os
import zlib
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save
from torch import Tensor

from room2dgs.errors import InputError
from room2dgs.files import whole_file
from room2dgs.regular_files import open_regular

FORMAT = 1
LONGEST_HEADER = 4 << 20  # bytes; ours have some thousand
DAMAGE = (
    SafetensorError, OSError, LookupError, ValueError, TypeError, AttributeError, RuntimeError, ArithmeticError,
)  # fmt: skip
KEY = "room2dgs"  # one metadata entry: safetensors does not keep the order of several


def write_tensors(path: Path, kind: str, tensors: dict[str, Tensor], meta: dict[str, Any]) -> None:
    """Write atomically; the same tensors and metadata give the same bytes.

    Raises:
        InputError: the file cannot be written.
    """
    plain = {name: tensors[name].detach().cpu().contiguous() for name in sorted(tensors)}
    header = {"format": FORMAT, "kind": kind, "crc32": _checksum(plain), **meta}
    data = save(plain, {KEY: json.dumps(header, sort_keys=True)})
    try:
        with whole_file(path) as temporary:
            temporary.write_bytes(data)
    except OSError as error:
        reason = error.strerror or str(error)
        raise InputError(f"{path} cannot be written ({reason}); make room or give another folder") from error


def read_tensors(path: Path, *kinds: str) -> tuple[dict[str, Tensor], dict[str, Any]]:
    """Read and check what `write_tensors` wrote.

    Args:
        kinds: any of these will do; the metadata's "kind" says which it is.

    Raises:
        InputError: missing, truncated, damaged, another kind of file or a newer format.
    """
    _check_header(path)
    try:
        with safe_open(path, framework="pt") as file:
            meta = json.loads((file.metadata() or {})[KEY])
            tensors = {name: file.get_tensor(name) for name in sorted(file.keys())}
    except DAMAGE as error:
        raise InputError(f"{path} is not a whole room2dgs file; delete it and train again") from error
    if not isinstance(meta, dict) or meta.get("kind") not in kinds:
        raise InputError(f"{path} does not hold a {' or '.join(kinds)}; give the file that training wrote")
    if meta.get("format") != FORMAT:
        raise InputError(f"{path} has format {meta.get('format')}, not {FORMAT}; use the version that wrote it")
    if meta.get("crc32") != _checksum(tensors):
        raise InputError(f"{path} is damaged (its checksum differs); delete it and train again")
    return tensors, meta


def _check_header(path: Path) -> None:
    """A header that is longer than its file, or than any of ours, would be read, and its JSON built, before it is told.

    Raises:
        InputError: no regular file, or such a header.
    """
    with open_regular(path, "train first, or give the folder of an earlier run") as file:
        length = int.from_bytes(file.read(8), "little")
        if length > min(LONGEST_HEADER, os.fstat(file.fileno()).st_size):
            raise InputError(f"{path} is not a whole room2dgs file; delete it and train again")


def _checksum(tensors: dict[str, Tensor]) -> int:
    value = 0
    for name in sorted(tensors):
        value = zlib.crc32(tensors[name].reshape(-1).view(torch.uint8).numpy().data, zlib.crc32(name.encode(), value))
    return value
