"""Settings of every engine: each reaches the engine, and comes back from it in the manifest."""

from __future__ import annotations

import pytest

from touchstone.adapters.contract import Settings, Unsupported
from touchstone.adapters.knobs import Numbers, SettingError
from touchstone.adapters.registry import ENGINES, changes_of, installed, load, settings_of
from touchstone.scenarios.catalogue import catalogue

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
    ("mujoco", "solref=0.01", "geom_solref", "[[-14400.0, -51.708902871899234], [-10000.0, -200.0]]"),
    (
        "mujoco",
        "solimp=0.5:0.6:0.002:0.4:3",
        "geom_solimp",
        "[[0.5, 0.6, 0.002, 0.4, 3.0]]",
    ),
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
    ("dart", "solver=pgs", "lcp_solver", "PgsBoxedLcpSolver"),
    ("dart", "solver=nsgs", "lcp_solver", "NsgsFrictionSolver"),
    ("dart", "solver=fbf", "lcp_solver", "FbfFrictionSolver"),
    ("dart", "solver=nsgs iterations=7", "lcp_iterations", 7),
    ("dart", "solver=fbf tolerance=0.001", "lcp_tolerance", 1e-3),
    ("dart", "detector=fcl", "detector", "fcl"),
    ("dart", "detector=dart", "detector", "dart"),
    ("dart", "detector=ode", "detector", "ode"),
    ("dart", "split_impulse=on", "split_impulse", True),
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
    with pytest.raises(SettingError, match=r"unknown engine 'mujco' .valid: reference, dart"):
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
