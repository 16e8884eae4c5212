"""A picture that cannot be drawn costs the picture only."""

from __future__ import annotations

import pytest

from touchstone.reports.results import illustrate
from touchstone.reports.studies.calibration import study


def test_a_failing_picture_is_named_and_leaves_no_file(tmp_path, capsys):
    """One line names the file and the reason; nothing half-written stays."""

    def draw(path):
        path.write_text("half")
        raise ValueError("no data\nand more")

    illustrate(tmp_path / "a.png", draw)
    assert capsys.readouterr().err == "touchstone: a.png is not written: ValueError: no data\n"
    assert list(tmp_path.iterdir()) == []


def test_an_interruption_is_not_swallowed(tmp_path):
    """Ctrl-C during a picture ends the program."""

    def draw(path):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        illustrate(tmp_path / "a.png", draw)


def test_a_study_keeps_its_rows_without_a_picture(tmp_path, monkeypatch, capsys):
    """Rows and manifest of a study are saved although its page and its picture fail."""

    def broken(*_):
        raise RuntimeError("no fonts")

    monkeypatch.setattr(study, "report", broken)
    monkeypatch.setattr(study, "requested_and_achieved", broken)
    study.run((), tmp_path / "out", lambda label, steps: None)
    assert sorted(path.name for path in (tmp_path / "out").iterdir() if path.is_file()) == [
        "manifest.json",
        "results.csv",
        "results.parquet",
    ]
    assert capsys.readouterr().err.count("is not written: RuntimeError: no fonts") == 2
