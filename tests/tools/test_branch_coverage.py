"""Coverage of a small package, from its data file to its table."""

from __future__ import annotations

from pathlib import Path

from coverage import CoverageData

from room2dgs.tools.branch_coverage import ROOT, by_package, coverage_table, main, package_of


def entry(lines: int, covered: int, branches: int, taken: int) -> dict[str, dict[str, int]]:
    names = ("num_statements", "covered_lines", "num_branches", "covered_branches")
    return {"summary": dict(zip(names, (lines, covered, branches, taken), strict=True))}


def test_files_belong_to_the_package_whose_folder_they_lie_in():
    assert package_of(Path("room2dgs/mesh/sub/fuse.py")) == "mesh"
    assert package_of(ROOT / "room2dgs" / "depth" / "state.py") == "depth"
    assert package_of(Path("eval/scoring.py")) == "eval"
    assert package_of(Path("room2dgs/cli.py")) == "(modules)"


def test_figures_are_added_up_before_they_are_divided():
    files = {"room2dgs/mesh/a.py": entry(30, 30, 4, 1), "room2dgs/mesh/b.py": entry(10, 0, 0, 0)}
    files["eval/c.py"] = entry(60, 30, 12, 3)
    shown = coverage_table(by_package(files))
    assert [list(row) for row in shown.frame.to_numpy()] == [
        ["eval", "60", "50.0%", "12", "25.0%"],
        ["mesh", "40", "75.0%", "4", "25.0%"],
        ["all", "100", "60.0%", "16", "25.0%"],
    ]


def test_the_table_of_a_measured_file(tmp_path, capsys):
    data = tmp_path / "data"
    measured = CoverageData(basename=str(data))
    measured.add_arcs({str(ROOT / "eval" / "scoring.py"): [(-1, 1), (1, 3), (3, 5)]})
    measured.write()
    assert main([str(data)]) == 0
    (line,) = [line for line in capsys.readouterr().out.splitlines() if "eval" in line]
    _, name, lines, covered, branches, _ = (cell.strip() for cell in line.split("│")[:6])
    assert name == "eval" and int(lines) > 20 and 0 < float(covered.rstrip("%")) < 20 and int(branches) > 5


def test_nothing_measured_is_one_sentence(tmp_path, capsys):
    assert main([str(tmp_path / "none")]) == 2
    assert "make coverage writes it" in capsys.readouterr().err
