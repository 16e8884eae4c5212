"""Newton's law contact by contact, and impulses across empty space."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from touchstone.reports.metrics.contacts.contact import REFERENCE_SPEED
from touchstone.reports.metrics.context import NotMeasured
from touchstone.scenarios.catalogue import catalogue

UP = (0.0, 0.0, 1.0)


def struck(recordings, known, scenario, time, **rows):
    """The scene's closed form with one contact of its first two bodies."""
    row = {"time": time, "body_a": 0, "body_b": 1, "normal": UP, "impulse": (0.0, 0.0, 2.0)} | rows
    return known.ideal(recordings, scenario, contacts=recordings.contacts(row))


@pytest.mark.parametrize(("before", "after", "breach"), [(-2.0, 1.0, 0.0), (-2.0, 1.5, 0.5), (0.3, 0.0, 0.0)])
def test_newtons_law_per_contact(recordings, known, before, after, breach):
    """What a contact leaves beyond e times the approach counts over 1.4 m/s; e = 0.5 here."""
    scenario = catalogue()["bounce_e05"]
    recording = struck(
        recordings,
        known,
        scenario,
        0.2,
        velocity_b_before=(0.0, 0.0, before),
        velocity_b_after=(0.0, 0.0, after),
    )
    found = known.value("contact.complementarity", recording, scenario)[""]
    assert found == pytest.approx(breach / REFERENCE_SPEED, abs=1e-15)


def test_breaches_are_weighted_by_impulse(recordings, known):
    """A contact without impulse, or one that pulls, weighs nothing."""
    scenario = catalogue()["bounce_e05"]
    rows = [
        {"body_b": 1, "normal": UP, "impulse": (0.0, 0.0, j), "velocity_b_after": (0.0, 0.0, v)}
        for j, v in ((3.0, 0.14), (1.0, 0.0), (0.0, 9.0), (-1.0, 9.0))
    ]
    recording = known.ideal(recordings, scenario, contacts=recordings.contacts(*rows))
    found = known.value("contact.complementarity", recording, scenario)[""]
    assert found == pytest.approx(0.75 * 0.1, rel=1e-12)


@pytest.mark.parametrize("early", [0.0, 0.003, 0.01, -0.003])
def test_a_contact_beside_the_touch(recordings, known, early):
    """An impulse some milliseconds before or after the ball is there acts across the gap it has then."""
    scenario = catalogue()["bounce_e1"]
    arrival = scenario.truths[0].arcs[1].start
    recording = struck(recordings, known, scenario, arrival - early)
    speed = scenario.truths[0].arcs[1].velocity[2]
    gap = speed * abs(early) - 9.81 * early**2 / 2
    found = known.value("contact.at_distance", recording, scenario)[""]
    # the oracle's distance of a ball over a box is exact
    assert found == pytest.approx(gap, abs=1e-12)


def test_contacts_in_touch_are_at_no_distance(recordings, known):
    """A body that lies, slides or overlaps has no gap."""
    scenario = catalogue()["slide"]
    rows = [
        {"time": k / 60, "body_b": 1 + k % 3, "normal": UP, "impulse": (0.0, 0.0, 0.1)} for k in range(90)
    ]
    recording = known.ideal(recordings, scenario, contacts=recordings.contacts(*rows))
    # the oracle's 1e-8 m
    assert known.value("contact.at_distance", recording, scenario)[""] < 1e-8
    sunk = replace(
        recording, position=recording.position - np.array([0.0, 0.0, 1e-3]) * (np.arange(4) > 0)[:, None]
    )
    assert known.value("contact.at_distance", sunk, scenario)[""] == 0.0


def test_without_pressing_contacts_nothing_is_measured(recordings, known):
    """No contact, or none that presses, is not measured."""
    scenario = catalogue()["bounce_e1"]
    empty = known.ideal(recordings, scenario)
    pulling = struck(recordings, known, scenario, 0.1, impulse=(0.0, 0.0, -1.0))
    for recording in (empty, pulling):
        for metric in ("contact.complementarity", "contact.at_distance"):
            with pytest.raises(NotMeasured, match="no contact presses"):
                known.value(metric, recording, scenario)


def test_contacts_of_driven_bodies_have_no_gap(recordings, known):
    """How a driven body moves within a frame is not known: its contacts tell Newton's law alone."""
    scenario = catalogue()["spring"]
    row = {"body_a": 0, "body_b": 1, "normal": UP, "impulse": (0.0, 0.0, 1.0)}
    recording = recordings.recording(scenario, contacts=recordings.contacts(row))
    assert known.value("contact.complementarity", recording, scenario) == {"": 0.0}
    with pytest.raises(NotMeasured, match="no contact presses"):
        known.value("contact.at_distance", recording, scenario)


def test_restitution_of_two_free_balls(recordings, known):
    """A head-on collision is judged by its free arcs; one off centre, whose normal turns, is not."""
    scenario = catalogue()["collide_central"]
    found = known.value("restitution.achieved", known.ideal(recordings, scenario), scenario)
    assert list(found) == ["mover-target #1"]
    assert found["mover-target #1"].value == pytest.approx(0.5, abs=1e-12)
    assert found["mover-target #1"].reason == "asked 0.5, approach 2.00 m/s"
    oblique = catalogue()["collide_slips"]
    with pytest.raises(NotMeasured, match="no bounce faster"):
        known.value("restitution.achieved", known.ideal(recordings, oblique), oblique)


def test_rounding_of_a_normal_is_no_friction(recordings, known):
    """A frictionless impulse may have a few roundings of itself across the normal, and no more."""
    scenario = catalogue()["collide_oblique"]
    normal = np.array([0.6, 0.0, 0.8])
    for across, fine in ((1e-16, True), (1e-14, False)):
        impulse = 2.0 * normal + 2.0 * across * np.array([0.8, 0.0, -0.6])
        recording = struck(recordings, known, scenario, 0.2, normal=normal, impulse=impulse)
        assert (known.value("friction.cone", recording, scenario)[""].value < 1e-12) == fine
        assert (known.value("friction.cone.point", recording, scenario)[""] < 1e-12) == fine
