"""The paper's claims on the shape of the work over a scene: on counts in profile `paper`, never on times."""

from collections.abc import Callable

import numpy as np
import pytest

from touchstone.scenarios.catalogue import catalogue

SCENES = ("ball_snip", "wall_push", "corner_slide", "two_arms", "table_slide", "arms_cross")
"""The paper's scenes, and one in which arms meet: persons and hands that push nothing loose but a ball."""
WITH_CHAINS = [name for name in SCENES if catalogue()[name].chains]
FRAME_RATE = 60
TENTH = FRAME_RATE // 10
"""A tenth of a second [frames]."""

Counts = Callable[[str, str], np.ndarray]


@pytest.fixture(scope="module")
def counts(registry) -> Counts:
    """A counter of a scene, frame by frame."""

    def of(scene: str, name: str) -> np.ndarray:
        recording = registry.played(scene, "reference", "paper")
        return recording.work[:, list(recording.work_names).index(name)]

    return of


def runs(flags: np.ndarray) -> list[tuple[int, int]]:
    """(first, end) of each stretch of true frames."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], flags, [False]))))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist()))


@pytest.mark.parametrize(("scene", "pushes"), [("wall_push", 1), ("two_arms", 3)])
def test_iterations_spike_at_first_contact(counts: Counts, scene: str, pushes: int) -> None:
    """Take most iterations within a tenth of a second of each first contact, and at most half after it."""
    iterations, touching = counts(scene, "ccd.passes"), runs(counts(scene, "pairs.contacting") > 0)
    assert len(touching) == pushes
    for first, _ in touching:
        peak = iterations[first : first + TENTH].max()
        assert peak > 0
        after = iterations[first + TENTH : first + 3 * TENTH]
        assert np.median(after) <= peak / 2
    # no later frame, settled or with one more limb, takes as many as the first contact
    starts = [first for first, _ in touching]
    assert min(abs(iterations.argmax() - first) for first in starts) < TENTH


def test_two_arms_spikes_three_times_in_the_second_half(counts: Counts) -> None:
    """Turn joints in three stretches, all in the second half, each with a spike as high as the others'."""
    iterations = counts("two_arms", "ccd.passes")
    pushes = runs(iterations > 0)
    assert len(pushes) == 3
    assert pushes[0][0] >= len(iterations) // 2
    peaks = [iterations[first:end].max() for first, end in pushes]
    # the same push three times; what coherence keeps from frame to frame is forgotten between them
    assert max(peaks) - min(peaks) <= 0.1 * max(peaks)
    assert len(runs(iterations > max(peaks) / 2)) == 3


def test_contacting_pairs_peak_in_the_corner(counts: Counts) -> None:
    """Have more pairs in contact at a time in `corner_slide` than in any other scene."""
    most = {scene: counts(scene, "pairs.contacting").max() for scene in SCENES}
    corner = most.pop("corner_slide")
    assert corner > max(most.values())


def test_table_slide_has_two_plateaus_and_spikes_at_its_end(counts: Counts) -> None:
    """Move freely at first, keep a constant count over each slide, and peak while playing with the ball."""
    pairs, pressed = counts("table_slide", "pairs"), counts("table_slide", "pairs.contacting") > 0
    plateaus = [(first, end) for first, end in runs(pressed) if end - first >= 5 * TENTH]
    assert len(plateaus) == 2
    (first, left), (again, done) = plateaus
    free = pairs[1 : first - 1]
    assert first > 0.45 * len(pairs)
    assert np.ptp(free) == 0
    for start, end in plateaus:
        # but for the first frames of contact, which may take a second round
        assert np.mean(pairs[start:end] == pairs[start]) > 0.9
        assert pairs[start] > free[0]
    # a brief break between the slides, as cheap as before
    assert 0 < again - left < FRAME_RATE
    assert pairs[left:again].min() == free[0]
    # spikes: higher than all before, or alone
    assert pairs.argmax() >= done
    spikes = runs(counts("table_slide", "events") > 0)
    assert len(spikes) >= 2
    assert all(start >= done and end - start <= 3 for start, end in spikes)


def test_inverse_kinematics_grows_with_joints(counts: Counts) -> None:
    """Order the scenes equally by joints turned and by iterations, and frames within a scene in trend."""
    order = {
        name: sorted(WITH_CHAINS, key=lambda scene: counts(scene, name).sum())
        for name in ("ik.joints", "ccd.passes")
    }
    assert order["ik.joints"] == order["ccd.passes"]
    assert order["ik.joints"][-1] == "corner_slide"
    joints, iterations = (
        np.concatenate([counts(scene, name) for scene in WITH_CHAINS]) for name in ("ik.joints", "ccd.passes")
    )
    some = joints > 0
    assert (iterations[some] > 0).all()
    assert not iterations[~some].any()
    # frames that turn twice the joints take more iterations: medians over thirds of the frames, by joints
    thirds = np.array_split(iterations[some][np.argsort(joints[some], kind="stable")], 3)
    low, _, high = map(np.median, thirds)
    assert low < high
