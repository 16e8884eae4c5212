"""Drake: registered like an engine of others, friction by its combine rule, no restitution, its SAP
artefact."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from touchstone.adapters.conformance.check import check
from touchstone.adapters.contract import Settings, Unsupported
from touchstone.adapters.knobs import SettingError
from touchstone.adapters.recorder import record
from touchstone.adapters.registry import DEFAULT_ENGINES, ENGINES, changes_of, load, registered, settings_of
from touchstone.reports.metrics import METRICS
from touchstone.reports.metrics.context import Context
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.materials import TABLE_1
from touchstone.scenarios.scenario import Box, PairCoefficients, Piece, Sphere

pytest.importorskip("pydrake", reason="drake is not installed (pip install drake)")
DT = 1 / 1020
G = 9.81
READ_BACK = {
    # profile, change, key of the manifest, value
    (
        "default",
        "approximation=similar",
        "discrete_contact_approximation",
        "DiscreteContactApproximation.kSimilar",
    ),
    ("default", "approximation=tamsi", "discrete_contact_solver", "DiscreteContactSolver.kTamsi"),
    ("default", "point_stiffness=2e7", "point_stiffness", 2e7),
    ("default", "contact_model=hydroelastic", "contact_model", "ContactModel.kHydroelasticWithFallback"),
    ("recommended", "hydroelastic_modulus=2e7", "hydroelastic_modulus", 2e7),
    ("recommended", "resolution_hint=0.01", "resolution_hint", 0.01),
    ("recommended", "integrator=cenic", "integrator", "cenic"),
    ("cenic", "accuracy=1e-5", "accuracy", 1e-5),
    ("tamsi", "hunt_crossley_dissipation=3", "hunt_crossley_dissipation", 3.0),
    ("sap", "relaxation_time=0.01", "relaxation_time", 0.01),
    ("default", "stiction_tolerance=1e-3", "stiction_tolerance (as set)", 1e-3),
    ("sap", "sap_near_rigid_threshold=0", "sap_near_rigid_threshold", 0.0),
}


@pytest.fixture(autouse=True)
def named():
    """Drake is known as long as a test of this file runs."""
    registered("drake")


def settings(profile: str = "default") -> Settings:
    return Settings(profile, ENGINES["drake"].profiles[profile])


def test_it_plays_only_when_it_is_named():
    """Drake is not among the engines that play by default."""
    assert "drake" not in DEFAULT_ENGINES


@pytest.mark.parametrize(("profile", "text", "key", "value"), sorted(READ_BACK, key=str))
def test_a_setting_reaches_drake(profile, text, key, value):
    """The manifest holds the value as Drake reports it; the profile's own value changes nothing."""
    changes = changes_of("drake", profile, (text,))
    world = load("drake").build(catalogue()["slip"], replace(settings(profile), changes=changes))
    world.step()
    assert world.describe().settings[key] == value
    world.close()
    own = settings_of("drake").values_of(profile)
    assert changes_of("drake", profile, [f"{name}={one}" for name, one in own.items()]) == ()


def test_every_setting_of_drake_is_read_back_here():
    """READ_BACK has every setting; one without effect is refused with its reason."""
    assert {text.partition("=")[0] for _, text, *_ in READ_BACK} == set(settings_of("drake"))
    with pytest.raises(SettingError, match="relaxation_time: does nothing with approximation=lagged"):
        changes_of("drake", "default", ("relaxation_time=0.01",))


def test_the_stiction_tolerance_is_that_of_a_plant():
    """Drake has no getter of it: the table states the default of a plant's configuration."""
    from pydrake.multibody.plant import MultibodyPlantConfig

    table = settings_of("drake")
    assert {float(one) for one in table["stiction_tolerance"].profiles} == {
        MultibodyPlantConfig().stiction_tolerance
    }


def test_a_contact_is_as_stiff_as_its_geometries():
    """Both geometries give in series: a load of m sinks by m g / 5e5 N/m under Drake's defaults."""
    scenario = catalogue()["bounce_e0"]
    ball = next(body for body in scenario.bodies if body.kind == "simulated")
    run = record(load("drake"), scenario, settings())
    depth = -run.contacts["distance"][run.contacts["time"] > scenario.duration - 0.05]
    assert depth == pytest.approx(ball.mass * G / 5e5, rel=0.02)


@pytest.mark.slow
@pytest.mark.parametrize("profile", ["recommended", "default", "tamsi"])
def test_the_adapter_conforms(profile):
    """The checks of conformance find no fault."""
    assert [(report.check, report.faults) for report in check("drake", profile) if report.faults] == []


def test_free_fall_is_of_first_order():
    """Free fall is off by g h T / 2, as in the other engines: semi-implicit Euler."""
    scenario = catalogue()["fall"]
    run = record(load("drake"), scenario, settings())
    error = run.position[-1, 0, 2] + G * scenario.duration**2 / 2
    assert error == pytest.approx(-G * DT * scenario.duration / 2, rel=1e-6)


def test_friction_is_combined_harmonically(lab):
    """Factors per body are solved so that each pair has its own coefficient; the manifest reads it back."""
    wood = lab.scene(lab.ground(), lab.ball("one"), lab.ball("two", (0.0, 1.0, 1.0)))
    floor, one, two = wood.bodies
    bodies = (floor, replace(one, material="metal"), two)
    table = (
        PairCoefficients("wood", "wood", 0.0, 0.5),
        PairCoefficients("wood", "metal", 0.0, 0.2),
        PairCoefficients("metal", "metal", 0.0, 0.9),
    )
    scenario = replace(wood, bodies=bodies, coefficients=table)
    world = load("drake").build(scenario, settings())
    found = {(pair.body_a, pair.body_b): pair.friction for pair in world.describe().pairs}
    world.close()
    assert found == pytest.approx({("ground", "one"): 0.2, ("ground", "two"): 0.5, ("one", "two"): 0.2})


def test_restitution_is_refused_or_left_out(lab):
    """Drake has none: scenes of bounces are refused with the pair; the paper's materials do not bounce."""
    bouncing = lab.scene(lab.ground(), lab.ball(), e=0.8)
    with pytest.raises(Unsupported, match=r"drake: has no restitution; found 0.8 for the pair ground-ball"):
        load("drake").build(bouncing, settings())
    assert max(pair.restitution for pair in TABLE_1) <= 0.3
    falling = lab.scene(lab.ground(), lab.ball(position=(0.0, 0.0, 0.15)), e=0.3, duration=0.5)
    run = record(load("drake"), falling, settings())
    assert run.linear_velocity[:, 1, 2].max() < 0.05
    assert run.facts["pairs"][0]["restitution"] == 0.0


def test_a_box_stands_on_one_point():
    """Point contact has one point for each pair of pieces: the cause of most known failings."""
    scenario = catalogue()["tip_holds"]
    rows = record(load("drake"), scenario, settings()).contacts
    steps = np.floor(rows["time"] / DT + 1e-6).astype(int)
    assert np.bincount(steps).max() == 1


@pytest.mark.parametrize("profile", ["recommended", "cenic"])
def test_pressure_holds_cubes(profile):
    """Cubes stand on their faces, sink by their pressure fields, and each face bears what stands on it."""
    scenario, one = catalogue()["stack"], settings(profile)
    run = record(load("drake"), scenario, one)
    assert np.abs(run.position[-1] - run.position[0]).max() < 4e-4
    rows = run.contacts[run.contacts["time"] > scenario.duration - 1.5 * one.dt]
    assert [(row["body_a"] + 1) for row in rows] == [row["body_b"] for row in rows]
    masses = [body.mass for body in scenario.bodies]
    for b, impulse in zip(rows["body_b"], rows["impulse"]):
        weight = sum(masses[b:]) * G * one.dt
        np.testing.assert_allclose(impulse, [0, 0, weight], atol=1e-3 * weight)


def _with_corner_balls(scenario, radius):
    """The scenario with a ball in each corner of its simulated boxes, whose boxes are inset."""
    bodies = []
    for body in scenario.bodies:
        pieces = list(body.pieces) if body.kind == "simulated" else []
        for k, piece in enumerate(body.pieces if pieces else ()):
            half = np.array(piece.shape.half_extents)
            pieces[k] = replace(piece, shape=Box(tuple((half - radius / 5).tolist())))
            for signs in product((-1, 1), repeat=3):
                at = tuple((np.array(signs) * (half - radius)).tolist())
                pieces.append(Piece(f"corner {signs}", Sphere(radius), position=at))
        bodies.append(replace(body, pieces=tuple(pieces)) if pieces else body)
    return replace(scenario, bodies=tuple(bodies))


@pytest.mark.parametrize("profile", ["default", "sap", "tamsi"])
def test_corner_balls_hold_what_one_point_lets_go(profile):
    """One point is the cause: with a ball in each corner the box on the incline holds, under all three."""
    scenario = catalogue()["incline_holds"]
    moved = []
    for played in (scenario, _with_corner_balls(scenario, 1e-3)):
        run = record(load("drake"), played, settings(profile))
        moved.append(np.linalg.norm(run.position[-1] - run.position[0], axis=1).max())
    assert moved[0] > 4e-3
    assert moved[1] < 1e-3


def test_sap_relaxes_slowly():
    """The default relaxation time of 0.1 s leaves a ball deep after its impact; 10 ms do not."""
    scenario, deep = catalogue()["bounce_e0"], []
    for changes in ((), ("relaxation_time=0.01",)):
        run = record(load("drake"), scenario, replace(settings("sap"), changes=changes))
        deep.append(-run.contacts["distance"][-1])
    assert deep[0] > 2e-4
    assert deep[1] < 5e-5


@pytest.mark.parametrize(("profile", "least", "most"), [("default", 0.01, 0.2), ("tamsi", 0.0, 1e-6)])
def test_lagged_friction_leaves_the_cone(profile, least, most):
    """The default approximation bounds friction by the normal force of the step before; TAMSI does not."""
    scenario = catalogue()["slip"]
    run = record(load("drake"), scenario, settings(profile))
    found = METRICS["friction.cone"].measure(Context(run, scenario))[""]
    assert least <= getattr(found, "value", found) <= most


def test_sap_lifts_what_slides(lab):
    """The convex approximation couples slip and normal: a ball that slides over a floor is thrown up."""
    ball = lab.ball(position=(0.0, 0.0, 0.05), linear_velocity=(2.0, 0.0, 0.0))
    scenario = lab.scene(lab.ground(), ball, mu=0.5, duration=0.1)
    up = {p: record(load("drake"), scenario, settings(p)).position[:, 1, 2].max() for p in ("sap", "default")}
    assert up["sap"] > 0.055
    assert up["default"] < 0.0502


@pytest.mark.slow
def test_it_plays_ball_snip():
    """The hand of fifteen parts flicks the ball off the table."""
    scenario = catalogue()["ball_snip"]
    run = record(load("drake"), scenario, settings())
    k = scenario.body_index("ball")
    assert run.position[-1, k, 2] < 0.1 < run.position[0, k, 2]
    angles = np.array(scenario.trackers[0].angles[-1])
    assert np.abs(run.joint_angle[-1] - angles).max() < 0.05
