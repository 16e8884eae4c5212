"""What holds in every frame of every scene of the gallery, under every profile of the reference."""

import numpy as np
import pytest

from touchstone.adapters.engines.reference.settings import PROFILES
from touchstone.adapters.oracles.overlap import measure
from touchstone.reference_impl.core.conventions import OVERLAP_TOLERANCE
from touchstone.reports.metrics.context import Context
from touchstone.reports.metrics.posture import cone_excess, limit_excess
from touchstone.scenarios.avatar.tracking import sample
from touchstone.scenarios.catalogue import catalogue, tagged

SCENES = [scenario.name for scenario in tagged("gallery")]
ORACLE_SLACK = 2e-8
"""Beyond the tolerance [m]: what coal's own tolerance leaves."""
ROUNDING = 1e-9
"""Of angles that are projected and measured again [rad]."""
ARC_COSINE = 1e-7
"""What `paper` leaves of an angle near 0: 1.5e-8 rad by acos, over the passes of a few hinges [rad]."""


@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize("scene", SCENES)
def test_every_frame_is_free_or_counted(registry, scene: str, profile: str) -> None:
    """Show no overlap by coal, or count the frame as given up: none in `balanced` and `accurate`. Bend no
    joint beyond its limits and swing no bone out of its reach cone."""
    recording = registry.played(scene, "reference", profile)
    gave_up = recording.work[:, list(recording.work_names).index("gave_up")]
    depth = measure(recording, catalogue()[scene]).overlap()[1:]
    assert len(depth) == len(gave_up)
    assert depth[gave_up == 0].max() <= OVERLAP_TOLERANCE + ORACLE_SLACK
    if profile != "paper":
        assert not gave_up.any()
    context = Context(recording, catalogue()[scene])
    assert limit_excess(context).max() == 0
    cones = [cone for chain in context.scenario.chains for cone in chain.cones]
    for cone in cones:
        assert cone_excess(context, cone).max() <= ROUNDING


@pytest.mark.parametrize("profile", ["balanced", "accurate"])
@pytest.mark.parametrize("scene", ["wall_push", "corner_slide", "two_arms", "arms_cross"])
def test_free_limbs_are_where_the_tracker_has_them(registry, scene: str, profile: str) -> None:
    """Show the tracker's own posture, without a lag, until something is met."""
    recording = registry.played(scene, "reference", profile)
    contacting = recording.work[:, list(recording.work_names).index("pairs.contacting")]
    met = int((contacting > 0).argmax())
    assert met > 30
    tracked = sample(catalogue()[scene].trackers[0], recording.time).angle
    np.testing.assert_allclose(recording.joint_angle[: met + 1], tracked[: met + 1], rtol=0, atol=ROUNDING)


@pytest.mark.parametrize("profile", PROFILES)
def test_two_arms_push_as_mirror_images(registry, profile: str) -> None:
    """Bend left and right equally all the time: equal angles are mirrored postures."""
    names = catalogue()["two_arms"].trackers[0].joints
    angle = registry.played("two_arms", "reference", profile).joint_angle
    left = [k for k, name in enumerate(names) if name.startswith("left")]
    right = [names.index(names[k].replace("left", "right")) for k in left]
    assert np.ptp(angle[:, left], axis=0).max() > 1
    # the same operations on mirrored numbers, rounded equally but for sums in another order
    slack = ARC_COSINE if profile == "paper" else ROUNDING
    np.testing.assert_allclose(angle[:, left], angle[:, right], rtol=0, atol=slack)
