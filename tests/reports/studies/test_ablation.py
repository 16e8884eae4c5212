"""The study `ablation`: its variations, rows and table, from effects that are given."""

from math import isnan, log

import pytest

from touchstone.adapters.contract import Settings
from touchstone.adapters.engines.reference.variable import MECHANISMS, constants
from touchstone.adapters.workers.pool import Ended
from touchstone.reports.results import table
from touchstone.reports.studies.ablation import (
    Effect,
    Variation,
    idle,
    lines_of,
    mechanisms_picture,
    report,
    rows_of,
    variations,
)
from touchstone.reports.studies.study import RefusedError

SETTINGS = Settings("balanced", 1 / 60)
CAP, GUARD = "geometry.gjk.GJK_CAP", "energy guard"


@pytest.fixture
def frame():
    """Rows of a mechanism that matters, of a constant that does not, and of one that ends its process."""
    guard = Effect(["stack", "wall"], ["wall energy.injected"], [], [log(2.0), log(8.0)], [0.5, 0.6, 0.7])
    tasks = {
        Variation(SETTINGS, GUARD, "off"): guard,
        Variation(SETTINGS, CAP, "times 4", 256): Effect(times=[1.0, 1.0, 1.0]),
        Variation(SETTINGS, CAP, "over 4", 16): Effect(),
        Variation(SETTINGS, "frame.TIME_MIN", "times 4", 4e-12): Ended("error", "the process died"),
    }
    return table(row for task, found in tasks.items() for row in rows_of(task, found))


def test_everything_is_varied_and_names_choose():
    """Every mechanism is switched off, every constant multiplied and divided; a wrong name is refused."""
    every = variations((), "balanced", 3)
    assert len(every) > len(MECHANISMS) + 1.8 * len(constants())
    assert len({(one.subject, one.change) for one in every}) == len(every)
    chosen = variations(["GJK_CAP", "energy guard off"], "balanced", 3)
    assert [(one.subject, one.change, one.value) for one in chosen[1:]] == [
        (CAP, "times 4", 256),
        (CAP, "over 4", 16),
    ]
    assert (chosen[0].subject, isnan(chosen[0].value)) == (GUARD, True)
    with pytest.raises(RefusedError, match="called 'NO_SUCH'"):
        variations(["NO_SUCH"], "balanced", 3)
    with pytest.raises(RefusedError, match="profile paper"):
        variations((), "paper", 3)


def test_a_line_tells_what_a_variation_buys_and_costs(frame):
    """A line has the counts, the mean ratio of errors, the median ratio of times, and what breaks."""
    lines = {(line[0], line[2]): line for line in lines_of(frame)}
    assert lines[GUARD, "off"][3:7] == ["2", "1", "0", "4"]
    assert lines[GUARD, "off"][7].startswith("0.60 (0.5")
    assert lines["gjk.GJK_CAP", "times 4"][1:7] == ["64.0", "times 4", "0", "0", "0", ""]
    assert lines["frame.TIME_MIN", "times 4"][3:6] == ["ended"] * 3
    assert idle(frame) == [CAP]


def test_the_table_and_the_picture_show_it(shown, frame, tmp_path):
    """The table says what moves nothing; the picture is drawn."""
    text = shown(report(frame), 160)
    assert "energy guard off: wall energy.injected" in text
    assert f"moves no scene in either direction: {CAP}" in text
    mechanisms_picture(frame, tmp_path / "ablation.png")
    assert (tmp_path / "ablation.png").stat().st_size > 5000
