"""The table of scores."""

from room2dgs.eval.report import table


def test_table_has_every_protocol_and_no_invented_number():
    text = table({"area": {"f_score_5cm": 0.875, "accuracy_m": 0.0123}, "neuris": {"f_score_5cm": None}}, "5cm")
    assert "0.875" in text
    assert "12.3 mm" in text
    row = next(line for line in text.splitlines() if "F-score" in line)
    assert row.split("│")[3].strip() == "-"
