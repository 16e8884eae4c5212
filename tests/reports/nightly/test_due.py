"""Studies of nights: when they are due, and how their rows are kept and compared."""

from __future__ import annotations

from pathlib import Path

import pytest

from touchstone.reports.nightly.night import HARD, OUTCOME, Study, due, rows_for_nights, studies
from touchstone.reports.nightly.store import Night
from touchstone.reports.nightly.verdict import GONE, REGRESSION, compared_with, physics
from touchstone.reports.results import Row, table


def _study(name, period=7, seconds=10.0):
    return Study(name, period, seconds, lambda out, scratch, progress: table([]))


def _nights(*held, fingerprint="one"):
    return [
        Night(Path(), {"run": f"{k}", "sequence": k, "fingerprint": fingerprint, "studies": studies})
        for k, studies in enumerate(held, start=1)
    ]


def _names(*arguments, **options):
    return [study.name for study in due(*arguments, **options)]


def test_periods_are_counted_in_nights_of_one_machine():
    """A study is due when its period is over; nights of other machines do not count."""
    every = [_study("a", 3)]
    assert _names(every, [], "one") == ["a"]
    nights = _nights({"a": 9.0}, {}, {})
    assert _names(every, nights[:2], "one") == []
    assert _names(every, nights, "one") == ["a"]
    assert _names(every, nights, "two") == ["a"]
    assert _names(every, _nights({"a": 9.0}, None, 3, fingerprint="one"), "one") == ["a"]


def test_hard_cases_come_first_and_the_longest_overdue_next():
    """Of many that are due a night takes two beside the hard cases."""
    every = [_study("a", 2), _study("b", 2), _study("c", 8), _study(HARD, 1)]
    nights = _nights({"a": 1.0}, {"b": 1.0}, *[{}] * 8, {HARD: 1.0})
    assert _names(every, nights, "one") == [HARD, "c", "a"]


def test_a_study_must_fit_into_the_time_that_is_left():
    """By what it took the last time here; before that, by its entry."""
    every = [_study("a", 1, seconds=10.0), _study("b", 1, seconds=50.0)]
    assert _names(every, [], "one", left=30.0) == ["a"]
    assert _names(every, _nights({"a": 40.0, "b": 5.0}), "one", left=30.0) == ["b"]
    assert _names(every, [], "one", left=-1.0) == []


def test_all_families_have_their_turn():
    """Hard cases rotate; a quick night has fewer."""
    assert studies(0, quick=True)[0].seconds < studies(0, quick=False)[0].seconds
    assert {study.name for study in studies(3, quick=False)} >= {HARD, "calibration", "relations"}


def _hard(name, engine="mujoco", verdict=""):
    return Row(
        HARD, "hard_mass_1e6", engine, "recommended", 1 / 540, OUTCOME, 1e6, subject=name, verdict=verdict
    )


def test_rows_are_kept_without_times_and_with_their_step():
    """Times are left out, several steps become part of the subject, classes become numbers."""
    base = ("agreement", "fall", "mujoco", "recommended")
    rows = [
        Row(*base, 1 / 60, "agreement.error", 1e-3, "m"),
        Row(*base, 1 / 240, "agreement.error", 1e-4, "m"),
        Row(*base, 1 / 240, "time.frame", 1e-4, "s"),
        _hard("ok"),
        Row(HARD, "mass", "mujoco", "recommended", 1 / 540, "stability.survived", 3.0, subject="jitter"),
    ]
    kept = rows_for_nights(table(rows))
    assert kept.subject.tolist() == ["at 1/60 s", "at 1/240 s", ""]
    assert kept.verdict.tolist() == ["", "", "pass"]
    assert kept.reason.iloc[-1] == "ok"


@pytest.mark.parametrize(
    ("before", "after", "kind"), [("ok", "exploded", REGRESSION), ("jitter", "ok", GONE), ("ok", "ok", None)]
)
def test_an_outcome_that_changes_is_a_finding(before, after, kind):
    """A hard case that is no longer survived is a regression, named by its classes."""
    found = physics(rows_for_nights(table([_hard(after)])), rows_for_nights(table([_hard(before)])))
    assert [(one.kind, one.moved) for one in found] == ([(kind, f"{before} -> {after}")] if kind else [])


@pytest.mark.parametrize(("accepted", "said"), [(0, "ok"), (2, "jitter"), (3, "jitter")])
def test_what_the_accepted_night_lacks_is_compared_with_one_that_had_it(store, nights, accepted, said):
    """With the last night before it, else with the first after it: a change stays a finding until it is
    accepted."""
    study, other = (rows_for_nights(table([_hard(name)])) for name in ("ok", "jitter"))
    for number, frame in enumerate((nights.frame(), study, other, nights.frame())):
        store.add(frame, nights.facts(number))
    found = store.nights()
    assert set(compared_with(store, found, found[accepted], nights.frame()).scenario) == {"fall"}
    assert compared_with(store, found, found[accepted], study).reason.tolist() == [said]
