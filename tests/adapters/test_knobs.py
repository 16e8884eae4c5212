"""Tables of settings: each reaches its engine or the reference's state, and comes back from it by name."""

from dataclasses import replace

import numpy as np
import pytest

from touchstone.adapters.contract import Settings, Unsupported
from touchstone.adapters.engines.reference.engine import ReferenceEngine
from touchstone.adapters.engines.reference.settings import (
    COLUMNS,
    EQUAL,
    PAPER,
    PROFILES,
    SETTINGS,
    configure,
    describe,
)
from touchstone.adapters.knobs import Choice, Numbers, SettingError
from touchstone.adapters.recorder import record
from touchstone.adapters.registry import ENGINES, changes_of, installed, load, settings_of
from touchstone.reference_impl.core.state_dtype import STATE
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.scenario import Body, Box, PairCoefficients, Piece, Scenario, Sphere, Tracker
from touchstone.scenarios.solids import box_inertia, sphere_inertia

HALF = (0.05, 0.05, 0.05)
WOKEN = Scenario(
    "woken",
    "a ball slides without friction into a box that has slept for a while",
    (),
    (
        Body("floor", "fixed", "wood", (Piece("slab", Box((6.0, 1.0, 0.5))),), position=(0.0, 0.0, -0.5)),
        Body("box", "simulated", "wood", (Piece("box", Box(HALF)),), position=(0.0, 0.0, 0.05), mass=1.0,
             inertia=box_inertia(1.0, HALF)),
        Body("ball", "simulated", "ice", (Piece("ball", Sphere(0.05)),), position=(-4.6, 0.0, 0.05), mass=1.0,
             inertia=sphere_inertia(1.0, 0.05), linear_velocity=(1.0, 0.0, 0.0)),
    ),
    5.5,
    (
        PairCoefficients("wood", "wood", 0.0, 0.3),
        PairCoefficients("wood", "ice", 0.0, 0.0),
    ),
)  # fmt: skip

READ_BACK = {
    # engine, change, key of the manifest, value
    ("mujoco", "integrator=RK4", "integrator", "mjINT_RK4"),
    ("mujoco", "integrator=implicit", "integrator", "mjINT_IMPLICIT"),
    ("mujoco", "integrator=Euler", "integrator", "mjINT_EULER"),
    ("mujoco", "solver=PGS", "solver", "mjSOL_PGS"),
    ("mujoco", "solver=CG", "solver", "mjSOL_CG"),
    ("mujoco", "cone=pyramidal", "cone", "mjCONE_PYRAMIDAL"),
    ("mujoco", "cone=elliptic", "cone", "mjCONE_ELLIPTIC"),
    ("mujoco", "iterations=7", "iterations", 7),
    ("mujoco", "tolerance=0.001", "tolerance", 1e-3),
    ("mujoco", "impratio=3", "impratio", 3.0),
    ("mujoco", "noslip_iterations=4", "noslip_iterations", 4),
    ("mujoco", "solref=0.02", "geom_solref", "[[-8225.393616375599, -44.33218240627144], [0.02, 1.0]]"),
    (
        "mujoco",
        "bounce=0.1",
        "geom_solref",
        "[[-561.0754213613177, -11.945691489429953], [0.010833333333333334, 1.0]]",
    ),
    ("mujoco", "integrator=discrete", "integrator", "mjINT_DISCRETE"),
    ("mujoco", "solreffriction=0.1", "pair_solreffriction", "[[-1.0, -20.0]]"),
    ("mujoco", "speculative=on", "speculative", True),
    ("mujoco", "sleep=on", "sleep", True),
    ("mujoco", "solimp=0.5:0.6:0.002:0.4:3", "geom_solimp", "[[0.5, 0.6, 0.002, 0.4, 3.0]]"),
    ("bullet", "numSolverIterations=7", "numSolverIterations (read back)", 7),
    ("bullet", "solverResidualThreshold=0.001", "solverResidualThreshold (as set)", 1e-3),
    ("bullet", "numSubSteps=3", "numSubSteps (read back)", 3),
    ("bullet", "erp=0.3", "erp (as set)", 0.3),
    ("bullet", "contactERP=0.3", "contactERP (as set)", 0.3),
    ("bullet", "frictionERP=0.3", "frictionERP (as set)", 0.3),
    ("bullet", "contactSlop=0.003", "contactSlop (as set)", 0.003),
    ("bullet", "globalCFM=0.001", "globalCFM (as set)", 0.001),
    ("bullet", "warmStartingFactor=0.5", "warmStartingFactor (as set)", 0.5),
    ("bullet", "restitutionVelocityThreshold=0.1", "restitutionVelocityThreshold (as set)", 0.1),
    ("bullet", "constraintSolverType=dantzig", "constraintSolverType (as set)", 3),
    ("bullet", "coordinates=maximal", "bodies in maximal coordinates", 2),
    ("bullet", "useSplitImpulse=off", "useSplitImpulse (as set)", 0),
    ("bullet", "splitImpulsePenetrationThreshold=-0.01", "splitImpulsePenetrationThreshold (as set)", -0.01),
    ("bullet", "enableConeFriction=off", "enableConeFriction (as set)", 0),
    ("bullet", "contactBreakingThreshold=0.01", "contactBreakingThreshold (as set)", 0.01),
    ("bullet", "contactProcessingThreshold=0.001", "contactProcessingThreshold (as set)", 0.001),
    ("bullet", "collisionMargin=0.001", "collisionMargin (as set)", 0.001),
    ("bullet", "frictionAnchor=on", "bodies with friction anchors", 2),
    ("bullet", "sleep=on", "activationState (as set)", 1),
    ("dart", "solver=pgs", "lcp_solver", "PgsBoxedLcpSolver"),
    ("dart", "solver=nsgs", "lcp_solver", "NsgsFrictionSolver"),
    ("dart", "solver=fbf", "lcp_solver", "FbfFrictionSolver"),
    ("dart", "solver=nsgs iterations=7", "lcp_iterations", 7),
    ("dart", "solver=fbf tolerance=0.001", "lcp_tolerance", 1e-3),
    ("dart", "detector=fcl", "detector", "fcl"),
    ("dart", "detector=dart", "detector", "dart"),
    ("dart", "detector=ode", "detector", "ode"),
    ("dart", "split_impulse=on", "split_impulse", True),
    ("dart", "matrix_free=on", "matrix_free_solver", True),
    ("dart", "sleep=on", "deactivation", True),
}


def test_every_setting_is_read_back_here():
    """READ_BACK has every setting of the three engines but those that only apply with another."""
    found = {(engine, change.partition("=")[0]) for engine, text, *_ in READ_BACK for change in text.split()}
    assert found == {(name, key) for name in ENGINES if name != "reference" for key in settings_of(name)}


@pytest.mark.parametrize(("engine", "text", "key", "value"), sorted(READ_BACK, key=str), ids=lambda v: str(v))
def test_a_setting_reaches_its_engine(engine, text, key, value):
    """The manifest holds the value as the engine reports it, and its label names the change."""
    if not installed(engine):
        pytest.skip(f"{engine} is not installed")
    settings = Settings("recommended", 1 / 240, tuple(text.split()))
    world = load(engine).build(catalogue()["bounce_e05"], settings)
    manifest = world.describe()
    world.step()
    world.close()
    assert manifest.settings[key] == (pytest.approx(value) if isinstance(value, float) else value)


@pytest.mark.parametrize("engine", [name for name in ENGINES if name != "reference"])
def test_a_table_tells_what_profiles_do(lab, engine):
    """To set what a profile sets anyway changes nothing in the manifest."""
    if not installed(engine):
        pytest.skip(f"{engine} is not installed")
    scene = lab.scene(lab.ball())
    for k, profile in enumerate(settings_of(engine).profiles):
        plain = [f"{s.name}={s.profiles[k]}" for s in settings_of(engine).values() if s.profiles[k]]
        assert changes_of(engine, profile, plain) == ()
        reported = []
        for changes in ((), tuple(plain)):
            world = load(engine).build(scene, Settings(profile, 1 / 240, changes))
            reported.append(world.describe().settings)
            world.close()
        assert reported[0] == reported[1]


def test_an_engine_takes_its_own_changes():
    """A prefix names the engine; a setting without one concerns all."""
    texts = ("mujoco.solver=CG", "dart.solver=pgs", " mujoco.impratio = 3")
    assert changes_of("mujoco", "recommended", texts) == ("solver=CG", "impratio=3.0")
    assert changes_of("dart", "recommended", texts) == ("solver=pgs",)
    assert changes_of("bullet", "recommended", texts) == ()
    with pytest.raises(SettingError, match="bullet: unknown setting 'solver'"):
        changes_of("bullet", "recommended", ("solver=CG",))
    with pytest.raises(SettingError, match=r"unknown engine 'mujco'; did you mean 'mujoco'"):
        changes_of("bullet", "recommended", ("mujco.solver=CG",))


def test_dantzig_takes_no_iterations(lab):
    """DART's direct solver refuses what it would pass over in silence."""
    if not installed("dart"):
        pytest.skip("dart is not installed")
    with pytest.raises(Unsupported, match="need an iterative solver: pgs, nsgs or fbf"):
        load("dart").build(lab.scene(lab.ball()), Settings("recommended", 1 / 240, ("iterations=7",)))


@pytest.mark.parametrize("text", ["1:2", "1:2:x", "1:2:4", "", "nan:2:3"])
def test_numbers_are_checked_one_by_one(text):
    """As many as there are bounds, each within its own."""
    setting = Numbers("three", ((0, 1), (0, 2), (0, 3)), ("1:2:3",), "three numbers")
    assert setting.number("1:2:3") == (1.0, 2.0, 3.0)
    with pytest.raises(SettingError, match="found"):
        setting.number(text)


@pytest.mark.parametrize("engine", ["mujoco", "bullet", "dart"])
def test_a_sleeping_box_is_woken_by_what_hits_it(lab, engine):
    """In the profile `sleeping` a box at rest moves once a ball hits it, as fast as one that never slept."""
    if not installed(engine):
        pytest.skip(f"{engine} is not installed")
    ends = {}
    for profile in ("recommended", "sleeping"):
        recording = record(load(engine), WOKEN, Settings(profile, ENGINES[engine].profiles[profile]))
        ends[profile] = recording.linear_velocity[:, 1, 0]
        hit = recording.time > 4.4
        assert np.abs(ends[profile][~hit]).max() < 0.02 < np.abs(ends[profile][hit]).max()
    asleep = (recording.time > 4.0) & ~hit
    assert not ends["sleeping"][asleep].any()
    assert np.abs(ends["sleeping"]).max() == pytest.approx(np.abs(ends["recommended"]).max(), rel=0.1)


@pytest.mark.parametrize("engine", ["mujoco", "bullet", "dart"])
@pytest.mark.parametrize("way", [(0.3, 0.0, 0.0), (0.0, 0.0, 0.2), (0.0, 0.0, -0.3)])
def test_what_sleeps_goes_with_what_it_stands_on(engine, way):
    """A box that rests on a platform goes where it goes; DART's goes up with it, and else sleeps on."""
    if not installed(engine):
        pytest.skip(f"{engine} is not installed")
    still, unturned = (0.0, 0.0, -0.05), ((1.0, 0.0, 0.0, 0.0),) * 3
    moved = tuple(a + b for a, b in zip(still, way))
    platform = Body("platform", "prescribed", "wood", (Piece("slab", Box((1.0, 1.0, 0.05))),))
    tracker = Tracker("platform", (), (0.0, 3.0, 4.0), (still, still, moved), unturned, ((),) * 3)
    scene = replace(WOKEN, bodies=(platform, WOKEN.bodies[1]), duration=4.0, trackers=(tracker,))
    end = record(load(engine), scene, Settings("sleeping", ENGINES[engine].profiles["sleeping"]))
    sleeps_on = engine == "dart" and way[2] <= 0
    gone = (0.0, 0.0, 0.0) if sleeps_on else way
    assert end.position[-1, 1] - np.array((0.0, 0.0, 0.05)) == pytest.approx(np.array(gone), abs=1e-3)


def test_every_profile_is_a_column() -> None:
    """Set in the table what the registry promises, and nothing else."""
    assert set(SETTINGS.profiles) == set(ENGINES["reference"].profiles) == {*PROFILES, EQUAL}
    assert SETTINGS.values_of("equal-step") == SETTINGS.values_of("balanced")
    assert all(len(setting.profiles) == len(SETTINGS.profiles) - 1 for setting in SETTINGS.values())


@pytest.mark.parametrize("profile", [*COLUMNS, EQUAL])
def test_a_profile_is_read_back_as_it_was_set(profile: str) -> None:
    """Write a profile over a state full of other numbers; the same words come back."""
    state = np.zeros(1, STATE)
    for setting in SETTINGS.values():
        state[setting.name] = -1
    configure(state[0], profile)
    reported = {name: str(value) for name, value in describe(state[0]).items()}
    column = SETTINGS.profiles.index(profile)
    assert reported == {name: s.profiles[column] for name, s in SETTINGS.items()}
    assert SETTINGS.values_of(profile) == reported


@pytest.mark.parametrize(
    ("name", "value"), [(s.name, v) for s in SETTINGS.values() if isinstance(s, Choice) for v in s.values]
)
def test_a_change_changes_its_own_setting_alone(name: str, value: str) -> None:
    """Reach each named value of each setting from every profile, and leave all others alone."""
    for profile in COLUMNS:
        plain, state = np.zeros(1, STATE), np.zeros(1, STATE)
        configure(plain[0], profile)
        configure(state[0], profile, SETTINGS.changes(profile, [f" {name} = {value}"]))
        assert describe(state[0]) == {**describe(plain[0]), name: value}


def test_changes_have_one_spelling() -> None:
    """Drop what the profile sets anyway; order by the table, and write numbers the one way."""
    wanted = ["event_rows=1e3", "depth=exact", "removal=least_motion", "depth=exact"]
    assert SETTINGS.changes("balanced", wanted) == ("removal=least_motion", "depth=exact", "event_rows=1000")
    assert SETTINGS.changes("accurate", wanted) == ("depth=exact", "event_rows=1000")
    assert SETTINGS.changes("accurate", ["event_rows=16384.0"]) == ()
    assert Settings("balanced", 1 / 60, ("depth=exact",)).label == "balanced, depth=exact"


def test_paper_has_the_numbers_of_the_scene_alone(lab) -> None:
    """Refuse every setting under `paper` with what it has instead, and name its constants in the manifest."""
    for text in ("depth=exact", "friction=stick"):
        with pytest.raises(
            SettingError, match=r"profile paper has no such setting: .* K \(stiffness\) and R"
        ):
            SETTINGS.changes(PAPER, [text])
    assert SETTINGS.changes(PAPER, []) == ()
    assert SETTINGS.values_of(PAPER) == {}
    manifest = ReferenceEngine().build(lab.scene(lab.ball()), Settings(PAPER, 1 / 60)).describe()
    assert "depth" not in manifest.settings
    assert manifest.settings["attraction time"] == 0.1
