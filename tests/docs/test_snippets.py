"""Python on the pages compiles, and what it imports is there."""

from __future__ import annotations

import ast
import importlib

import pytest

from tests.docs.pages import blocks, pages

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
