"""Plans: effects by a scene's laws and reach, pieces that are kept, and what is asked for."""

from types import SimpleNamespace

from touchstone.adapters.motion_bounds import bounds
from touchstone.scenarios.effects import PLANNED
from touchstone.scenarios.plan import Plan, plan
from touchstone.scenarios.scenario import Scenario


def planned(scenario: Scenario, effects=None) -> Plan:
    return plan(scenario, bounds(scenario), effects)


def reason(made: Plan, effect: str) -> str:
    return made.decisions[PLANNED.index(effect)].reason


def test_rolling_friction_calls_for_friction(lab: SimpleNamespace) -> None:
    """Need friction where a law beyond mu alone acts, and not without either."""
    bodies = (lab.ground(), lab.ball())
    assert planned(lab.scene(*bodies, laws={"rolling_friction": 1e-3})).on("friction")
    assert not planned(lab.scene(*bodies)).on("friction")


def test_contact_by_reach(lab: SimpleNamespace) -> None:
    """Drop contact where a ball cannot come to the wall in the scene's time, and say how far it stays."""
    wall = lab.block("wall", (0.1, 1.0, 1.0), (6.0, 0.0, 0.0), kind="fixed")
    still = {"gravity": (0.0, 0.0, 0.0)}
    slow = planned(lab.scene(wall, lab.ball(linear_velocity=(4.0, 0.0, 0.0)), **still))
    assert not slow.on("contact")
    assert slow.pairs == ()
    assert slow.pieces == ((), ())
    # 6 m less half the wall, the way of 1 s, the radius and the slack for the engines' steps
    assert "wall and ball come nearest and stay 1.8 m apart" in reason(slow, "contact")
    assert planned(lab.scene(wall, lab.ball(linear_velocity=(6.0, 0.0, 0.0)), **still)).on("contact")


def test_energy_passed_on(lab: SimpleNamespace) -> None:
    """Let a ball at rest reach whatever the energy of one that can hit it allows."""
    fast = lab.ball("fast", (-1.0, 0.0, 0.0), linear_velocity=(3.0, 0.0, 0.0))
    target, wall = (
        lab.ball("target", (0.0, 0.0, 0.0)),
        lab.block("wall", (0.1, 1.0, 1.0), (5.5, 0.0, 0.0), "fixed"),
    )
    still = {"gravity": (0.0, 0.0, 0.0)}
    assert planned(lab.scene(fast, target, wall, e=1.0, **still)).pairs == ((0, 1), (1, 2))
    far = lab.block("wall", (0.1, 1.0, 1.0), (6.5, 0.0, 0.0), "fixed")
    assert planned(lab.scene(fast, target, far, e=1.0, **still)).pairs == ((0, 1),)


def test_only_pieces_in_reach_are_kept(lab: SimpleNamespace) -> None:
    """Keep of fixed bodies the pieces that something can come to."""
    near = lab.block("near", (1.0, 1.0, 0.1), (0.0, 0.0, 0.0), "fixed")
    far = lab.block("far", (1.0, 1.0, 0.1), (50.0, 0.0, 0.0), "fixed")
    made = planned(lab.scene(near, far, lab.ball()))
    assert made.pieces == ((0,), (), (0,))


def test_what_is_asked_for(lab: SimpleNamespace) -> None:
    """Run the effects named and no others, and say what the scene itself called for."""
    scene = lab.scene(lab.ground(), lab.ball(), mu=0.5)
    made = planned(scene, ("gravity", "contact", "restitution"))
    states = {one.effect: one.state for one in made.decisions}
    assert states["friction"] == "forced off"
    assert states["restitution"] == "forced on"
    assert states["gravity"] == "needed"
    assert reason(made, "friction") == "asked for; needed: mu = 0.5 between ground and ball"
    assert planned(scene, PLANNED).pairs == ((0, 1),)
    assert planned(scene, ()).pairs == ()
