"""The drive `posed`: kinematic links in every engine push what they meet."""

from types import SimpleNamespace

import numpy as np
import pytest
from engine_states import states

from touchstone.adapters.contract import Settings
from touchstone.adapters.motion_bounds import planned
from touchstone.adapters.posed_drive import Posed
from touchstone.adapters.recorder import record
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.scenario import Scenario

EQUAL = 1 / 240
FINE = 1 / 960
"""Step of DART's profile `accurate` where two codes are compared [s]."""
TOUCHED = 0.45
"""When the hand of `ball_snip` has pushed the ball for a tenth of a second [s]."""


@pytest.fixture(scope="module")
def snip() -> Scenario:
    """The hand that pushes a ball off a table."""
    scenario = catalogue()["ball_snip"]
    return planned(scenario).applied(scenario)


@pytest.mark.parametrize("name", ["mujoco", "bullet", "dart"])
def test_links_are_where_they_are_shown(registry: SimpleNamespace, snip: Scenario, name: str) -> None:
    """Pose the links as the tracker shows them, push the ball all the same, and report no drive."""
    engine, settings = registry.engine(name), Settings("equal-step", EQUAL, drive="posed")
    steps, touched = round(TOUCHED / EQUAL), 0
    palm, ball = snip.body_index("palm"), snip.body_index("ball")
    for state in states(engine, snip, settings, steps):
        touched += any(ball in (r["body_a"], r["body_b"]) for r in state.contacts[: state.contact_count])
    posed = Posed(snip, snip.trackers[0], EQUAL)
    links = list(posed.links)
    np.testing.assert_allclose(state.position[links], posed.place[:, steps], atol=1e-12)
    np.testing.assert_allclose(state.joint_angle, posed.angle[steps], atol=1e-12)
    assert touched
    assert state.linear_velocity[ball, 0] > 0.3
    assert np.isnan(state.force).all()
    assert np.isnan(state.hinge_torque).all()
    assert "none: links" in str(dict(engine.build(snip, settings).describe().settings))
    assert palm in links


@pytest.mark.parametrize(("drive", "most"), [("posed", 1e-3), ("native", 0.016)])
def test_two_codes_push_a_box_alike(registry: SimpleNamespace, drive: str, most: float) -> None:
    """A person pushes a box by 0.8 m in the reference as in DART: to 1 mm with kinematic links, and to
    2 % of the way where the hinges' servos give way."""
    scene, until = catalogue()["push_box"], 2.0
    columns = {"reference": ("balanced", EQUAL), "dart": ("accurate", FINE)}
    ways = []
    for name, (profile, dt) in columns.items():
        found = record(registry.engine(name), scene, Settings(profile, dt, drive=drive))
        ways.append(found.position[: round(until * scene.frame_rate) + 1, scene.body_index("box")])
    assert ways[0][-1, 0] - ways[0][0, 0] > 0.8
    assert np.linalg.norm(ways[0] - ways[1], axis=1).max() < most
