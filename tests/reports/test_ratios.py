"""Ratios of times: the ratio of medians, inside an interval that is the same each time."""

from __future__ import annotations

import numpy as np
import pytest

from reports.ratios import time_ratio


def noisy(seed, median, spikes=0.0, frames=180):
    """Times with noise that scatters by a tenth, and spikes on a share of the frames."""
    rng = np.random.default_rng(seed)
    times = median * np.exp(0.1 * rng.normal(size=frames))
    return times * np.where(rng.random(frames) < spikes, 50.0, 1.0)


def test_a_constant_ratio_is_exact():
    """Times that are a fixed share of others have that ratio with no width, whatever their noise."""
    theirs = noisy(1, 1e-4, spikes=0.3)
    ratio = time_ratio(theirs / 4, theirs)
    assert (ratio.value, ratio.low, ratio.high) == pytest.approx((0.25, 0.25, 0.25), rel=1e-12)


@pytest.mark.parametrize("seed", range(5))
def test_the_interval_holds_value_and_truth(seed):
    """The interval holds the ratio of medians and the truth and is a few percent wide, spikes or not."""
    ratio = time_ratio(noisy(seed, 2e-5, spikes=0.05), noisy(seed + 100, 1e-4))
    assert ratio.low <= ratio.value <= ratio.high
    # the median of 180 frames that scatter by a tenth is good to 1 %: 95 % of seeds, these were drawn once
    assert ratio.low * 0.99 < 0.2 < ratio.high * 1.01
    assert ratio.high / ratio.low < 1.15


def test_the_interval_is_reproducible():
    """The same times give the same interval to the bit; another seed another one."""
    ours, theirs = noisy(1, 2e-5), noisy(2, 1e-4)
    assert time_ratio(ours, theirs) == time_ratio(ours.copy(), theirs.copy())
    assert time_ratio(ours, theirs, seed=1) != time_ratio(ours, theirs)
    assert time_ratio(ours, theirs, seed=1).value == time_ratio(ours, theirs).value


def test_more_frames_narrow_the_interval():
    """Sixteen times the frames make the interval about four times as narrow."""
    widths = []
    for frames in (100, 1600):
        ratio = time_ratio(noisy(3, 1.0, frames=frames), noisy(4, 1.0, frames=frames))
        widths.append(ratio.high - ratio.low)
    assert 2 < widths[0] / widths[1] < 8


def test_frames_are_resampled_in_pairs():
    """Noise that both share cancels: slow frames of both do not widen the interval."""
    shared = noisy(5, 1.0, spikes=0.5)
    ratio = time_ratio(2 * shared, shared)
    assert ratio.high - ratio.low < 1e-9
