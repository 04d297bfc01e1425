import logging

import pytest

from room2dgs.logs import open_log, run_log


@pytest.fixture(autouse=True)
def _clean():
    logger = logging.getLogger("room2dgs")
    before = list(logger.handlers), logger.propagate, logger.level
    yield
    logger.handlers[:], logger.propagate = before[:2]
    logger.setLevel(before[2])


def test_lines_go_to_the_output_and_are_appended_to_the_runs_file(tmp_path, capsys):
    (tmp_path / "log.txt").write_text("from before\n")
    log = run_log(tmp_path)
    log("100 % of %s")
    logging.getLogger("room2dgs.anywhere").info("from %s", "within")
    assert capsys.readouterr().out == "100 % of %s\nfrom within\n"
    assert (tmp_path / "log.txt").read_text() == "from before\n100 % of %s\nfrom within\n"
    assert open_log() == tmp_path / "log.txt"


def test_a_second_run_has_its_own_file_and_no_line_comes_twice(tmp_path, capsys):
    first = run_log(tmp_path / "a")
    first("one")
    second = run_log(tmp_path / "b")
    second("two")
    first("three")  # as a study does between its runs
    second("four")
    assert capsys.readouterr().out == "one\ntwo\nthree\nfour\n"
    assert [(tmp_path / name / "log.txt").read_text() for name in "ab"] == ["one\nthree\n", "two\nfour\n"]
    assert open_log() == tmp_path / "b" / "log.txt"


def test_a_log_that_was_removed_is_written_anew(tmp_path):
    log = run_log(tmp_path)
    log("one")
    (tmp_path / "log.txt").unlink()
    assert open_log() is None
    log("two")
    assert (tmp_path / "log.txt").read_text() == "two\n"


def test_what_cannot_be_written_is_an_error_of_the_caller(tmp_path):
    log = run_log(tmp_path)
    (tmp_path / "log.txt").mkdir()
    with pytest.raises(IsADirectoryError):
        log("lost")
