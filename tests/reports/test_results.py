"""The long table and its files: fixed columns, whole or absent."""

import errno
from math import isnan, nan

import pandas as pd
import pytest

from touchstone.reports.results import COLUMNS, Row, illustrate, is_undecided, save, table, write_beside
from touchstone.reports.studies import calibration

ROW = Row(
    "run", "scene", "mujoco", "recommended", 1 / 540, "overlap.max", 1 / 3, "m", "a, b", reason='so "so"\n'
)


def test_columns_are_fixed():
    """The columns are those, in that order, whatever the rows, and with none at all."""
    names = "study scenario engine profile dt seed repeat metric subject body_a body_b value unit low high"
    assert (*names.split(), "limit", "verdict", "basis", "reason", "reason_code", "reproduce") == COLUMNS
    for rows in ([], [ROW], [ROW, ROW]):
        frame = table(rows)
        assert tuple(frame.columns) == COLUMNS
        assert len(frame) == len(rows)
    assert table([ROW]).iloc[0].subject == "a, b"


def test_files_hold_the_table(tmp_path):
    """CSV and parquet read back the rows: every digit, awkward texts, absent numbers."""
    frame = table([ROW, Row("run", "scene", "all", "", float("nan"), "run", verdict="skipped")])
    save(frame, tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["results.csv", "results.parquet"]
    parquet = pd.read_parquet(tmp_path / "results.parquet")
    pd.testing.assert_frame_equal(parquet, frame)
    texts = {name: str for name in COLUMNS if frame[name].dtype == object or name in ("reason", "subject")}
    back = pd.read_csv(
        tmp_path / "results.csv", keep_default_na=False, dtype=texts, na_values={"dt": [""], "value": [""]}
    )
    assert tuple(back.columns) == COLUMNS
    assert back.value[0] == 1 / 3
    assert back.reason[0] == ROW.reason
    assert isnan(back.value[1])
    assert back.verdict[1] == "skipped"


def test_an_interrupted_write_leaves_the_old_file(tmp_path):
    """When writing fails half-way the old file is whole, and no part of the new one is left."""
    path = tmp_path / "kept.txt"
    write_beside(path, lambda part: part.write_text("old"))

    def full(part):
        part.write_text("half")
        raise OSError(errno.ENOSPC, "No space left on device")

    with pytest.raises(OSError, match="No space"):
        write_beside(path, full)
    with pytest.raises(OSError, match="No space"):
        write_beside(tmp_path / "new.txt", full)
    assert [p.name for p in tmp_path.iterdir()] == ["kept.txt"]
    assert path.read_text() == "old"
    write_beside(path, lambda part: part.write_text("new"))
    assert path.read_text() == "new"


@pytest.mark.parametrize(
    ("metric", "low", "value", "high", "undecided"),
    [
        ("ratio.time", 0.7, 0.8, 0.9, True),
        ("ratio.time", 0.06, 0.4, 4.4, True),
        ("time.left", 0.7, 0.8, nan, True),
        ("time.left", 0.76, 0.8, 0.9, False),
        ("time.left", 0.6, 0.7, 0.74, False),
        ("time.left", nan, 0.7, nan, False),
        ("overlap.max", 0.7, 0.8, 0.9, False),
    ],
)
def test_an_interval_that_includes_the_limit_decides_nothing(metric, low, value, high, undecided):
    """Ratios of times on either side of a limit that their interval includes get no verdict."""
    row = Row("run", "scene", "reference", "", 1.0, metric, value, low=low, high=high)
    assert is_undecided(row, 0.75) == undecided


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

    monkeypatch.setattr(calibration, "page", broken)
    monkeypatch.setattr(calibration, "requested_and_achieved", broken)
    calibration.run((), tmp_path / "out", lambda label, steps: None)
    assert sorted(path.name for path in (tmp_path / "out").iterdir() if path.is_file()) == [
        "manifest.json",
        "results.csv",
        "results.parquet",
    ]
    assert capsys.readouterr().err.count("is not written: RuntimeError: no fonts") == 2
