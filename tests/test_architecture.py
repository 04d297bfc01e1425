"""The package's modules import in one direction, without cycles.

Imports are read from the source. Those at the top of a module and those inside functions count for the direction;
only the first for cycles. Imports for type checkers alone count for neither.
"""

from __future__ import annotations

import ast
from collections.abc import Iterable, Iterator
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
# Each folder or top-level module imports only from those before it.
FLOW = (
    *(
        "texts",
        "errors",
        "regular_files",
        "links_out",
        "owner",
        "blame",
        "logs",
        "registry",
        "registries",
        "files",
        "json_files",
        "commit",
        "cores",
        "thread_limit",
        "torch_threads",
        "system_libraries",
        "cuda_extension",
        "cuda_state",
        "kernels",
        "freed_memory",
        "parallel_map",
        "interrupts",
        "colmap",
    ),
    *("report",),
    *(
        "config",
        "geometry",
        "captures",
        "exposure",
        "sfm",
        "stereo",
        "depth",
        "mirrors",
        "splat",
        "primitives",
        "seeds",
        "losses",
        "train",
        "mesh",
    ),
    *(
        "eval",
        "runs",
        "lengths",
        "prepare",
        "export",
        "plan",
        "viewer",
        "pipeline",
        "app",
        "demo_room",
        "bench",
        "study",
        "doctor",
        "commands",
        "cli",
        "__main__",
        "tools",
    ),
)
# `eval` is a library of its own: these alone.
EVAL_NEEDS = {
    "errors",
    "logs",
    "registry",
    "registries",
    "owner",
    "files",
    "regular_files",
    "texts",
    "json_files",
    "config",
    "geometry",
    "captures",
    "mesh",
    "eval",
}
EXTENSION = "room2dgs._C"


def modules() -> dict[str, Path]:
    """Dotted name -> file, of the package and of the top-level folders that travel inside it."""
    found = {}
    for folder, package in (("room2dgs", "room2dgs"), ("eval", "room2dgs.eval"), ("tools", "room2dgs.tools")):
        for path in sorted((ROOT / folder).rglob("*.py")):
            parts = path.relative_to(ROOT / folder).with_suffix("").parts
            found[".".join([package, *(part for part in parts if part != "__init__")])] = path
    return found


MODULES = modules()


def imported(body: Iterable[ast.AST], functions: bool) -> Iterator[str]:
    """Modules that some statements import; with or without those inside functions."""
    for node in body:
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test):
            continue
        if isinstance(node, ast.FunctionDef) and not functions:
            continue
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "imports are absolute here"
            for alias in node.names:
                inner = f"{node.module}.{alias.name}"
                yield inner if inner in MODULES or inner == EXTENSION else str(node.module)
        else:
            yield from imported(ast.iter_child_nodes(node), functions)


def imports_of(name: str, functions: bool) -> set[str]:
    body = ast.parse(MODULES[name].read_text(encoding="utf-8")).body
    return {other for other in imported(body, functions) if other.startswith("room2dgs.") and other != EXTENSION}


def folder(name: str) -> str:
    return name.split(".")[1]


@pytest.mark.parametrize("name", [name for name in MODULES if name != "room2dgs"])
def test_a_module_imports_only_what_comes_before_it(name):
    own = FLOW.index(folder(name))
    later = {other for other in imports_of(name, functions=True) if FLOW.index(folder(other)) > own}
    assert not later, f"{name} imports {', '.join(sorted(later))}, which comes later in the flow"


def test_evaluation_needs_nothing_of_training():
    needed = {other: name for name in MODULES if folder(name + ".") == "eval" for other in imports_of(name, True)}
    assert not {other: name for other, name in needed.items() if folder(other) not in EVAL_NEEDS}


def test_no_module_imports_itself_in_a_circle():
    graph = {name: imports_of(name, functions=False) - {name} for name in MODULES}
    try:
        order = list(TopologicalSorter(graph).static_order())
    except CycleError as error:
        pytest.fail(f"import cycle: {' -> '.join(error.args[1])}")
    assert set(MODULES) - {"room2dgs"} <= set(order)
