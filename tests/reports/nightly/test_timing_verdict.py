"""Rules on times of nights, on synthetic histories with known steps."""

from __future__ import annotations

import numpy as np
import pytest

from touchstone.reports.nightly.timing_verdict import step, warns

NIGHTS, SERIES = 60, 500


def test_false_alarms_are_rare(nights):
    """Without a step at most 1 % of all series and nights are confirmed."""
    generator = np.random.default_rng(1)
    alarms = seen = 0
    for _ in range(SERIES):
        history = nights.noise(generator, NIGHTS)
        for end in range(1, NIGHTS + 1):
            alarms += step(history[:end]) is not None
            seen += 1
    assert alarms / seen <= 0.01


def test_steps_are_found(nights):
    """A step of 15 % is confirmed within three nights in at least three of four histories, near its night."""
    generator = np.random.default_rng(2)
    found, firsts = 0, []
    for _ in range(SERIES):
        history = nights.noise(generator, NIGHTS)
        history[40:] *= 1.15
        found += any(step(history[:end]) for end in (41, 42, 43))
        later = step(history[:46])
        if later:
            firsts.append(later.first)
    assert found / SERIES >= 0.75
    assert abs(np.median(firsts) - 40) <= 1


def test_a_step_without_noise_is_exact():
    """First night and ratio of a step in a quiet series, past nights without a value."""
    values = np.r_[np.full(20, 1.0), np.full(3, 1.2)]
    values = np.insert(values, 5, np.nan)
    found = step(values)
    assert (found.first, found.ratio) == (21, pytest.approx(1.2))
    assert warns(values)


@pytest.mark.parametrize("tail", [[1.0, 1.5, 1.0], [1.04] * 3, [0.5] * 3])
def test_spikes_small_steps_and_improvements_are_quiet(tail):
    """One spike, a step of less than 5 % and a step downwards neither warn nor confirm."""
    values = np.r_[np.full(20, 1.0), tail]
    assert step(values) is None
    assert not warns(values)


def test_two_of_three_warn_only():
    """Two slow nights of three warn, and are not yet confirmed."""
    values = np.r_[np.full(20, 1.0), 1.2, 0.99, 1.2]
    assert warns(values)
    assert step(values) is None


def test_few_nights_have_no_verdict():
    """Nothing is said about fewer nights than are needed."""
    values = np.r_[np.full(5, 1.0), np.full(3, 2.0)]
    assert step(values) is None
    assert not warns(values)
