"""Rules on times of nights, on synthetic histories with known steps."""

from __future__ import annotations

from math import comb

import numpy as np
import pytest

from touchstone.reports.nightly.verdict import FEWEST, chance, step, warns

NIGHTS, SERIES = 60, 400
JUDGED = FEWEST + 3
"""Nights of a history before which nothing is judged."""


def lognormal(generator, count):
    """Times over their truth: lognormal by 5 %, with spikes of 10 to 100 % in 8 % of the nights."""
    spikes = np.where(generator.random(count) < 0.08, 1 + generator.uniform(0.1, 1.0, count), 1.0)
    return np.exp(generator.normal(0, 0.05, count)) * spikes


@pytest.fixture(params=["gamma", "lognormal"])
def noise(request, nights):
    """Noise of nights: right-tailed, with spikes."""
    return {"gamma": nights.noise, "lognormal": lognormal}[request.param]


def rates(noise, series, seed):
    """Shares of quiet nights that are confirmed, and of steps of 15 % found in three nights."""
    generator = np.random.default_rng(seed)
    alarms = seen = found = 0
    for _ in range(series):
        history = noise(generator, NIGHTS)
        for end in range(JUDGED, NIGHTS + 1):
            alarms += step(history[:end]) is not None
            seen += 1
        history = noise(generator, NIGHTS)
        history[40:] *= 1.15
        found += any(step(history[:end]) for end in (41, 42, 43))
    return alarms / seen, found / series


def test_false_alarms_are_rare_and_steps_are_found(noise):
    """Without a step at most 1 % of the judged series and nights are confirmed; a step of 15 % is confirmed
    within three nights in at least three of four histories."""
    alarms, found = rates(noise, SERIES, seed=11)
    assert alarms <= 0.01
    assert found >= 0.75


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(20, 25))
def test_rates_on_many_histories(noise, seed, capsys):
    """The same on 2,000 histories per seed; prints both rates."""
    alarms, found = rates(noise, 2000, seed)
    with capsys.disabled():
        print(f"\nseed {seed}: false alarms {100 * alarms:.2f} %, steps found {100 * found:.1f} %")
    assert alarms <= 0.01
    assert found >= 0.75


def test_the_test_is_exact():
    """The smallest p-value is one over the number of choices of nights; equal nights have 1."""
    generator = np.random.default_rng(5)
    before = generator.normal(1.0, 0.01, 20)
    assert chance(before, np.full(3, 1.3)) == pytest.approx(1 / comb(23, 3))
    assert chance(before, before[:3]) > 0.05
    assert chance(np.ones(20), np.ones(3)) == 1


def test_steps_are_dated(nights):
    """The first night of a confirmed step is its night."""
    generator = np.random.default_rng(2)
    firsts = []
    for _ in range(100):
        history = nights.noise(generator, NIGHTS)
        history[40:] *= 1.15
        later = step(history[:46])
        if later:
            firsts.append(later.first)
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
