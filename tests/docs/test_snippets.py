"""Python on the pages compiles, and what it imports is there."""

from __future__ import annotations

import ast
import importlib
import re

import pytest

from tests.docs.pages import DOCS, blocks, pages

SNIPPETS = [block for page in pages() for block in blocks(page) if block.language == "python"]


@pytest.mark.parametrize("snippet", SNIPPETS, ids=[f"{one.page}-{i}" for i, one in enumerate(SNIPPETS)])
def test_a_snippet_imports_what_there_is(snippet):
    tree = ast.parse(snippet.text)
    compile(tree, snippet.page, "exec")
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                importlib.import_module(alias.name)
        elif isinstance(node, ast.ImportFrom):
            module = importlib.import_module(node.module)
            for alias in node.names:
                assert hasattr(module, alias.name), f"{node.module} has no {alias.name}"
        elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "room2dgs":
            assert hasattr(importlib.import_module("room2dgs"), node.attr), f"room2dgs has no {node.attr}"


def test_the_pages_have_snippets():
    assert len(SNIPPETS) >= 4


def test_what_the_python_page_documents_is_there():
    named = re.findall(r"^::: ([\w.]+)", (DOCS / "reference/python.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert len(named) > 15
    for name in (f"room2dgs.{one}" if one.startswith("eval.") else one for one in named):
        module, _, last = name.rpartition(".")
        if not hasattr(importlib.import_module(module), last):
            importlib.import_module(name)
