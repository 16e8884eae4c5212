"""Tables in narrow terminals: no number is cut off, words wrap."""

import io

import pytest
from rich.table import Table
from rich.text import Text

from touchstone.reports.results import Row, table
from touchstone.reports.views.render import NARROW, FittingConsole, console
from touchstone.reports.views.terminal import report

COLUMNS = [("reference", "balanced"), ("reference", "paper")]
COLUMNS += [(e, p) for e in ("dart", "bullet", "mujoco") for p in ("recommended", "accurate")]


def _wide(width):
    """What is printed of a table of ten columns."""
    made = Table(title="a title")
    made.add_column("scene", no_wrap=True)
    for k in range(9):
        made.add_column(f"engine {k}", justify="right", no_wrap=True)
    for k in range(3):
        made.add_row(f"a_scene_with_a_long_name_{k}", *(Text(f"{j}.{k} (1 to 2)") for j in range(9)))
    out = FittingConsole(file=io.StringIO(), width=width)
    out.print(made)
    return out.file.getvalue()


@pytest.mark.parametrize("width", [40, 60, 80, 112])
def test_no_number_is_cut_off(width):
    """Every number is printed whole, in tables that fit the width; the title is printed once."""
    text = _wide(width)
    assert max(map(len, text.splitlines())) <= width
    assert "…" not in text
    assert all(f"{j}.{k} (1 to 2)" in text for j in range(9) for k in range(3))
    assert text.count("a title") == 1


def test_a_table_that_fits_is_one():
    """Nothing changes where there is room."""
    text = _wide(200)
    assert text.count("a_scene_with_a_long_name_0") == 1


def test_a_run_with_eight_columns_fits_80(shown):
    """The table of a run keeps its values, its legend and its marks."""
    rows = [
        Row("run", "slip", *column, 1 / 240, f"friction.{name}", 1234.5 + k, "1", subject="table-ball_22.5")
        for k, column in enumerate(COLUMNS)
        for name in ("deficit", "creep")
    ]
    text = shown(report(table(rows)), 80)
    assert max(map(len, text.splitlines())) <= 80
    assert "…" not in text
    assert all(f"{1234.5 + k:.0f}" in text for k in range(1, len(COLUMNS)))


def test_the_width_off_a_terminal(monkeypatch):
    """COLUMNS decides, or a width that suits files."""
    monkeypatch.delenv("COLUMNS", raising=False)
    assert console().width == NARROW
    monkeypatch.setenv("COLUMNS", "80")
    assert console().width == 80
