"""Assertions: each passes on the reference and fails on a fake, with what, where, how much and which body."""

import re
from dataclasses import replace

import numpy as np
import pytest

import touchstone as ts
from touchstone.adapters.recorder import scenario_json
from touchstone.adapters.recording import load
from touchstone.reports.assertions.invariants import INVARIANTS, check
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.scenario import Truth
from touchstone.scenarios.solids import ball, slab

RADIUS, G = 0.05, 9.81
TOUCH = {"time": [0.0], "body_a": [0], "body_b": [1], "normal": [[0, 0, 1]], "impulse": [[0, 0, 1]]}
SOUND = {
    "no_overlap": "bounce_e08",
    "no_tunnelling": "bounce_e08",
    "energy_not_created": "bounce_e08",
    "momentum_kept": "collide_sticks",
    "friction_cone": "slip",
    "restitution": "bounce_e08",
    "heading_independent": "slip",
}
"""A scene in which the reference keeps each invariant."""


def over_floor(e: float = 0.5, mu: float = 0.5, tags: tuple[str, ...] = (), height: float = 1.0, **fields):
    """A ball over a floor."""
    return ts.Scenario(
        "mine",
        "a test",
        tags,
        (slab("floor", "wood"), ball("ball", "wood", RADIUS, 1.0, (0.0, 0.0, height))),
        float(fields.pop("duration", 1.0)),
        (ts.PairCoefficients("wood", "wood", e, mu),),
        **fields,
    )


def arrays(scenario, height, speed, x=0.0, along=0.0, spin=0.0, contacts=None):
    """A recording of a ball whose height and vertical speed are given (f,)."""
    frames = len(height)
    position = np.tile([body.position for body in scenario.bodies], (frames, 1, 1))
    velocity, omega = np.zeros_like(position), np.zeros_like(position)
    position[:, 1] = np.stack([np.broadcast_to(x, frames), np.zeros(frames), height], axis=1)
    velocity[:, 1, 2], velocity[:, 1, 0], omega[:, 1, 1] = speed, along, spin
    return ts.recording(scenario, position, None, velocity, omega, contacts)


def falling(scenario, gain: float = 1.0):
    """A ball that falls with `gain` times gravity's acceleration."""
    time = np.arange(25) / 60
    return arrays(scenario, 1.0 - gain * G * time**2 / 2, -gain * G * time)


def pressed(scenario, tangential: float, frames: int = 31):
    """A ball that rests, pressed by its weight; the floor pulls it along x by `tangential` times the load."""
    load = G / 60
    time = np.arange(frames - 1) / 60
    speed = tangential * G * np.arange(frames) / 60
    way = np.concatenate([[0.0], np.cumsum(speed[1:]) / 60])
    contacts = {
        "time": time,
        "body_a": ["floor"] * len(time),
        "body_b": ["ball"] * len(time),
        "normal": np.tile([0.0, 0.0, 1.0], (len(time), 1)),
        "impulse": np.tile([tangential * load, 0.0, load], (len(time), 1)),
    }
    return arrays(scenario, np.full(frames, RADIUS), np.zeros(frames), way, speed, contacts=contacts)


def overlapping(_):
    height = np.full(61, RADIUS)
    height[40:] -= 3e-3
    return arrays(over_floor(), height, np.zeros(61))


def tunnelling(_):
    time = np.arange(31) / 60
    scenario = replace(over_floor(), gravity=(0.0, 0.0, 0.0))
    plate = (ts.Piece("plate", ts.Box((1.0, 1.0, 0.01))),)
    thin = replace(scenario.bodies[0], pieces=plate, position=(0.0, 0.0, 0.0))
    scenario = replace(scenario, bodies=(thin, scenario.bodies[1]))
    return arrays(scenario, 1.0 - 6.5 * time, np.full(31, -6.5))


def unkept(registry):
    run = registry.played("collide_sticks", "reference")
    velocity = run.linear_velocity.copy()
    velocity[30:, 0] *= 1.1
    return replace(run, linear_velocity=velocity)


def bouncing(known):
    time = np.arange(61) / 60
    gap, speed = known.bouncing(time, 0.95, 0.8)
    contacts = TOUCH | {"time": [(2 * 0.95 / G) ** 0.5]}
    return arrays(over_floor(e=0.5), RADIUS + gap, speed, contacts=contacts)


def turned_off(registry):
    run = registry.played("slip", "reference")
    position = run.position.copy()
    position[:, 1, 0] = position[0, 1, 0] + 1.1 * (position[:, 1, 0] - position[0, 1, 0])
    return replace(run, position=position)


FAKES = {
    "no_overlap": (
        overlapping,
        "overlap.max is 0.003 m, limit 0.001 m",
        "where: floor and ball, in frame 40 at 0.6667 s",
    ),
    "no_tunnelling": (tunnelling, "overlap.tunnelled is 1, limit 0", "one through the other"),
    "energy_not_created": (lambda _: falling(over_floor(), 1.3), "energy.injected", "where: ball, in frame"),
    "momentum_kept": (unkept, "momentum.linear", "in frame 30 at 0.5000 s"),
    "friction_cone": (
        lambda _: pressed(over_floor(mu=0.5), 0.9),
        "friction.cone is 0.7",
        "where: floor and ball, in frame",
    ),
    "restitution": (bouncing, r"restitution.error is 0.3", r"0.8\d\d at 4.\d\d m/s, asked 0.5"),
    "heading_independent": (turned_off, "friction.heading", "m from their start"),
}


@pytest.mark.parametrize("invariant", INVARIANTS)
def test_the_reference_keeps_each_invariant(registry, invariant):
    """Each assertion passes on the reference and returns the value of its metric."""
    scene = SOUND[invariant]
    assert getattr(ts, f"assert_{invariant}")(registry.played(scene, "reference")) <= 1e-5


@pytest.mark.parametrize("invariant", INVARIANTS)
def test_each_assertion_fails_on_its_fake(registry, known, invariant):
    """Each assertion fails on a run that breaks its law alone, and says what, by how much and where."""
    make, said, where = FAKES[invariant]
    run = make(known if invariant == "restitution" else registry)
    with pytest.raises(ts.InvariantError, match=re.compile(f"{said}.*{where}", re.DOTALL)) as error:
        getattr(ts, f"assert_{invariant}")(run)
    assert any(not finding.met for finding in error.value.findings)


def test_a_sound_run_of_arrays_passes():
    """Plain arrays of a sound simulator pass all assertions that apply to them."""
    ts.assert_energy_not_created(falling(over_floor()))
    run = pressed(over_floor(mu=0.5), 0.4)
    ts.assert_friction_cone(run)
    ts.assert_no_overlap(run)
    ts.assert_no_tunnelling(run)


def test_the_failure_names_the_command_that_shows_it(registry):
    """A run of a catalogue's scene is shown by a command, one of arrays by an expression."""
    shown = "shown by: touchstone run collide_sticks --engine reference --profile balanced --metric"
    with pytest.raises(ts.InvariantError, match=shown):
        ts.assert_momentum_kept(unkept(registry))
    with pytest.raises(ts.InvariantError, match=r"shown by: the run's position\[40, \[0, 1\]\]"):
        ts.assert_no_overlap(overlapping(None))


def bare(scenario):
    """A recording of positions alone."""
    return ts.recording(scenario, np.tile([body.position for body in scenario.bodies], (20, 1, 1)))


@pytest.mark.parametrize(
    ("invariant", "make", "said"),
    [
        ("energy_not_created", bare, "linear_velocity was not given"),
        ("no_tunnelling", bare, "linear_velocity was not given"),
        ("friction_cone", falling, "contacts was not given"),
        ("momentum_kept", falling, "not tagged isolated"),
        ("restitution", falling, "contacts was not given"),
        ("heading_independent", falling, "the scene has one heading"),
        ("no_overlap", lambda s: replace(falling(s), ended="it diverged"), "the run ended .*: it diverged"),
    ],
)
def test_what_cannot_be_judged_fails(invariant, make, said):
    """An assertion that could not be judged fails with the reason; it does not pass."""
    with pytest.raises(ts.InvariantError, match=f"{invariant} could not be judged: .*{said}"):
        check(invariant, make(over_floor()), over_floor())


def test_impulses_that_do_not_balance_the_motion_are_not_believed():
    """The cone is judged only where the reported impulses explain the motion."""
    run = pressed(over_floor(mu=0.5), 0.4)
    doubled = run.contacts.copy()
    doubled["impulse"] *= 2
    said = "could not be judged: the engine's impulses miss the motion by 1"
    with pytest.raises(ts.InvariantError, match=said):
        ts.assert_friction_cone(replace(run, contacts=doubled))


def test_a_limit_of_ones_own_replaces_that_of_the_table():
    """`limit` loosens or tightens an assertion."""
    run = overlapping(None)
    assert ts.assert_no_overlap(run, limit=4e-3) == pytest.approx(3e-3)
    with pytest.raises(ts.InvariantError, match=re.compile("limit 0.002 m.*as given", re.DOTALL)):
        ts.assert_no_overlap(run, limit=2e-3)
    with pytest.raises(TypeError, match=r"limit: found '5mm', expected a number, overlap.max in \[m\]"):
        ts.assert_no_overlap(run, limit="5mm")


def test_determinism_is_to_the_bit(registry):
    """Equal runs pass; one bit of one body in one frame is found."""
    run = registry.played("slip", "reference")
    assert ts.assert_deterministic(run, replace(run, position=run.position.copy())) == 0
    other = run.position.copy()
    other[7, 2, 1] = np.nextafter(other[7, 2, 1], 1.0)
    name = catalogue()["slip"].bodies[2].name
    said = f"where: {name}, in frame 7 at 0.1167 s, the first difference"
    with pytest.raises(ts.InvariantError, match=said):
        ts.assert_deterministic(run, replace(run, position=other))
    contacts = run.contacts.copy()
    contacts["impulse"][0] *= 2
    with pytest.raises(ts.InvariantError, match="the contacts differ"):
        ts.assert_deterministic(run, replace(run, contacts=contacts))


def test_the_order_of_bodies_does_not_matter():
    """Bodies are compared by name; one that moves otherwise in another order is found."""
    scenario = over_floor()
    reverse = ts.reordered(scenario)
    run = falling(scenario)
    swapped = ts.recording(reverse, *(getattr(run, f)[:, ::-1] for f in ("position", "orientation")))
    assert ts.assert_order_independent(run, swapped) == 0
    moved = swapped.position.copy()
    moved[9:, 0, 0] += 1e-3
    said = re.compile("order is 0.001 m, limit 1e-06 m.*first beyond the limit in frame 9", re.DOTALL)
    with pytest.raises(ts.InvariantError, match=said):
        ts.assert_order_independent(run, replace(swapped, position=moved))
    with pytest.raises(ts.InvariantError, match="could not be judged: the order is the same"):
        ts.assert_order_independent(run, run)


STILL = np.zeros((5, 2, 3))


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (
            {"position": np.zeros((5, 3, 3))},
            r"position: found the shape \(5, 3, 3\), expected \('frames', 2, 3\); bodies are floor, ball",
        ),
        ({"position": STILL[:1]}, "found 1 frame"),
        ({"position": np.full((5, 2, 3), np.nan)}, "position: not finite in frame 0 of body 'floor'"),
        (
            {"position": STILL, "orientation": np.zeros((5, 2, 4))},
            "the quaternion of 'floor' in frame 0 has the length 0",
        ),
        (
            {"position": STILL, "linear_velocity": STILL[:4]},
            r"linear_velocity: found the shape \(4, 2, 3\), expected \(5, 2, 3\)",
        ),
        (
            {"position": STILL, "contacts": {"time": [0.0]}},
            "contacts: body_a and body_b and normal and impulse missing",
        ),
        ({"position": STILL, "contacts": TOUCH | {"body_a": ["flor"]}}, "no body 'flor'; bodies are floor"),
        ({"position": STILL, "contacts": TOUCH | {"normal": [[0, 0, 2]]}}, "a normal has not the length 1"),
        ({"position": STILL, "contacts": TOUCH | {"body_b": [0]}}, "bodies 0 and 0 in row 0 cannot touch"),
        ({"position": STILL, "dt": 0.0}, "dt: found 0.0, expected seconds"),
    ],
)
def test_wrong_arrays_are_refused_in_one_line(arguments, said):
    """Arrays of a wrong shape or value are named, with what was expected."""
    with pytest.raises(ValueError, match=said) as error:
        ts.recording(over_floor(), **arguments)
    assert "\n" not in str(error.value)


def test_contacts_may_name_bodies_in_any_order():
    """Contacts are turned so that A comes before B: normal and impulse change their sign."""
    scenario = over_floor()
    flipped = {"body_a": ["ball"], "body_b": ["floor"], "normal": [[0, 0, -1]], "impulse": [[0, 0, -2]]}
    row = ts.recording(scenario, np.zeros((5, 2, 3)), contacts=TOUCH | flipped).contacts[0]
    assert (row["body_a"], row["body_b"]) == (0, 1)
    assert row["normal"].tolist() == [0, 0, 1]
    assert row["impulse"].tolist() == [0, 0, 2]


def test_a_recording_holds_its_scenario(registry, tmp_path):
    """A recording of one's own scene is judged, also from its file; a text that is none is named."""
    slip = catalogue()["slip"]
    own = replace(registry.played("slip", "reference"), scenario=scenario_json(replace(slip, name="mine")))
    own.save(tmp_path / "mine.npz")
    assert ts.assert_no_overlap(load(tmp_path / "mine.npz")) < 1e-6
    run = replace(registry.played("slip", "reference"), scenario="{}")
    with pytest.raises(ValueError, match="pass scenario="):
        ts.assert_no_overlap(run)
    assert ts.assert_no_overlap(run, catalogue()["slip"]) < 1e-6
    assert isinstance(catalogue()["slip"].truths[0], Truth)
