"""MuJoCo behind the contract: conventions, translation, read-back, drive, impulses; its masks of contacts."""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from engine_states import last
from scipy.integrate import solve_ivp

from touchstone.adapters.contract import Settings, Unsupported
from touchstone.adapters.motion_bounds import planned
from touchstone.adapters.recorder import record
from touchstone.scenarios import scenario as sc
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.scenario import (
    Body,
    Box,
    Ellipsoid,
    Hull,
    PairCoefficients,
    Piece,
    Scenario,
    Sphere,
)
from touchstone.scenarios.solids import elliptic_hull, sphere_inertia

mujoco = pytest.importorskip("mujoco", reason="mujoco is not installed")
from touchstone.adapters.engines.mujoco import engine as mujoco_engine  # noqa: E402
from touchstone.adapters.engines.mujoco.contacts import (  # noqa: E402
    REST_STEPS,
    releasing_ratio,
    releasing_restitution,
    restitution_of,
    solref_of,
)
from touchstone.adapters.engines.mujoco.engine import MujocoEngine  # noqa: E402
from touchstone.adapters.engines.mujoco.masks import contact_filter  # noqa: E402
from touchstone.adapters.engines.mujoco.model import add_piece  # noqa: E402
from touchstone.adapters.engines.mujoco.settings import SETTINGS as TABLE  # noqa: E402

ENGINE = MujocoEngine()
DT = ENGINE.profiles["recommended"]
SETTINGS = Settings("recommended", DT)
R = 0.05
"""Half the height of every shape below [m]."""
SHAPES = {
    "sphere": Sphere(R),
    "box": Box((R, 0.06, R)),
    "ellipsoid": Ellipsoid((0.07, 0.06, R)),
    "hull": Hull(elliptic_hull((R, R, R))),
}


def scene(*bodies: Body, e: float = 0.3, mu: float = 0.3, duration: float = 1.0, **fields) -> Scenario:
    """A scene of bodies of one material."""
    pair = sc.PairCoefficients("wood", "wood", restitution=e, friction=mu)
    return Scenario("test", "a test", (), bodies, duration, (pair,), **fields)


def free(name: str, shape: sc.Shape, z: float, **fields) -> Body:
    """A simulated body of 1 kg at a height."""
    fields = {"mass": 1.0, "inertia": sphere_inertia(1.0, R), "position": (0.0, 0.0, z)} | fields
    return Body(name, "simulated", "wood", (Piece("piece", shape),), **fields)


FLOOR = Body("floor", "fixed", "wood", (Piece("slab", Box((4.0, 3.0, 0.1)), position=(0.0, 0.0, -0.1)),))


def test_hull_keeps_its_vertices() -> None:
    """Keep all 42 vertices of a hull and place them to single precision."""
    world = ENGINE.build(scene(FLOOR, free("hull", SHAPES["hull"], 1.0)), SETTINGS)
    model = world._model
    assert model.mesh_graph[model.mesh_graphadr[0]] == 42
    axes, geom = np.zeros(9), model.ngeom - 1
    mujoco.mju_quat2Mat(axes, model.geom_quat[geom])
    placed = model.mesh_vert @ axes.reshape(3, 3).T + model.geom_pos[geom]
    nearest = np.linalg.norm(placed[None] - np.array(elliptic_hull((R, R, R)))[:, None], axis=2).min(axis=1)
    assert nearest.max() < R * np.finfo(np.float32).eps


@pytest.mark.parametrize("dt", [1 / 540, 1 / 240, 1 / 60])
def test_contact_springs_stay_resolved(dt: float) -> None:
    """Keep every bounce's frequency below the profile's, and e = 0 in MuJoCo's own form."""
    settings = Settings("recommended", dt)
    for e in np.linspace(0.1, 1, 10):
        solref = np.array(solref_of(float(e), settings))
        assert np.sqrt(-solref[0]) <= TABLE.in_force("recommended", ())["bounce"] / dt * (1 + 1e-12)
        assert restitution_of(solref, settings) == pytest.approx(e, abs=1e-9)  # a root found to 1e-12
    assert solref_of(0.0, settings) == (REST_STEPS * dt, 1.0)
    assert solref_of(0.0, Settings("default", DT)) == pytest.approx((-2500, -100))
    assert restitution_of(np.array(solref_of(0.0, settings)), settings) == 0.0


ACCURATE = Settings("accurate", ENGINE.profiles["accurate"])


@pytest.mark.parametrize("zeta", [0.05, 0.3, 0.7, 0.9, 1.0, 1.5, 3.0])
def test_a_spring_that_may_not_pull(zeta: float) -> None:
    """Let go when the force turns: the closed form is what an integrated damped spring leaves."""

    def force(t: float, state: np.ndarray) -> float:
        return -state[0] - 2 * zeta * state[1]

    # it starts at the surface, moving in, where damping alone holds it: the force turns later
    force.terminal, force.direction = True, -1  # type: ignore[attr-defined]
    start, span = (0.0, -1.0), (0.0, 100.0)
    contact = solve_ivp(lambda t, s: (s[1], force(t, s)), span, start, events=force, rtol=1e-11, atol=1e-13)
    assert releasing_restitution(zeta) == pytest.approx(contact.y[1, -1], abs=1e-8)
    assert releasing_ratio(releasing_restitution(zeta)) == pytest.approx(zeta, abs=1e-7)


def test_the_ends_of_the_closed_form() -> None:
    """Return everything undamped, exp(-2) at critical damping, and ever less beyond."""
    assert releasing_restitution(0.0) == pytest.approx(1.0, abs=1e-15)
    assert releasing_restitution(1.0) == np.exp(-2)
    for side in (1 - 1e-9, 1 + 1e-9):
        assert releasing_restitution(side) == pytest.approx(np.exp(-2), abs=1e-8)
    assert releasing_ratio(1.0) == 0.0
    assert releasing_ratio(np.exp(-2)) == pytest.approx(1.0, abs=1e-7)
    falling = [releasing_restitution(zeta) for zeta in np.linspace(0, 5, 51)]
    assert (np.diff(falling) < 0).all()


@pytest.mark.parametrize("e", [0.05, 0.3, 1.0])
def test_accurate_steps_are_the_springs(e: float) -> None:
    """Step semi-implicitly through the samples of a damped spring of the wanted frequency."""
    dt, zeta = ACCURATE.dt, releasing_ratio(e)
    stiffness, damping = np.negative(solref_of(e, ACCURATE))
    x, v, samples = 1.0, 0.0, []
    for _ in range(20):
        v -= dt * (stiffness * x + damping * v)
        x += dt * v
        samples.append(x)
    roots = TABLE.in_force("accurate", ())["bounce"] * (
        -zeta + np.sqrt(complex(zeta * zeta - 1)) * np.array((1, -1))
    )
    basis = np.exp(np.outer(np.arange(1, 21), roots))
    fit = np.linalg.lstsq(basis, np.array(samples, complex), rcond=None)[0]
    np.testing.assert_allclose((basis @ fit).real, samples, atol=1e-10)


@pytest.mark.parametrize("dt", [ACCURATE.dt, 1 / 240, 1 / 60])
def test_accurate_restitutions_read_back(dt: float) -> None:
    """Find the restitution again in the stiffness and damping, on both sides of critical damping."""
    settings = Settings("accurate", dt)
    for e in (0.0, 0.05, 0.1, np.exp(-2), 0.2, 0.5, 0.9, 1.0):
        reported = restitution_of(np.array(solref_of(e, settings)), settings)
        assert reported == pytest.approx(e, abs=1e-9)  # a root found to 1e-12


def test_accurate_contacts_are_told_as_meant() -> None:
    """Read the elliptic cone, friction's own damping and a constant impedance off the compiled model."""
    scenario = scene(FLOOR, free("ball", SHAPES["sphere"], 1.0), e=0.4, mu=0.2)
    manifest = ENGINE.build(scenario, ACCURATE).describe()
    facts = manifest.settings
    assert (facts["cone"], facts["impratio"]) == ("mjCONE_ELLIPTIC", 10.0)
    assert facts["pair_solreffriction"] == "[[-1.0, -100.0]]"
    assert facts["pair_solimp"].startswith("[[0.95, 0.95,")
    assert (manifest.pairs[0].restitution, manifest.pairs[0].friction) == pytest.approx((0.4, 0.2), abs=1e-9)


@pytest.mark.parametrize("e", [0.3, 0.5, 0.8, 1.0])
def test_ball_bounces(e: float) -> None:
    """Bounce a ball of 2 m/s with its coefficient, on average over the phases of a step; a bounce takes only
    some eight steps, over which a single one spreads."""
    balls = [
        free(f"ball_{k}", SHAPES["sphere"], 0.0, linear_velocity=(0.0, 0.0, -2.0),
             position=(0.3 * k - 1.5, 0.0, R + (1 + k / 10) * 2 * DT))
        for k in range(10)
    ]  # fmt: skip
    scenario = scene(FLOOR, *balls, e=e, gravity=(0.0, 0.0, 0.0))
    state = last(ENGINE, scenario, SETTINGS, 40)
    assert np.mean(state.linear_velocity[1:, 2] / 2) == pytest.approx(e, abs=0.015)


def test_settings_are_neutral() -> None:
    """Switch off autoreset, sleep and damping and say so from the compiled model."""
    facts = ENGINE.build(scene(FLOOR, free("ball", SHAPES["sphere"], 1.0)), SETTINGS).describe().settings
    assert facts["autoreset"] is facts["sleep"] is False
    assert facts["dof_damping_max"] == facts["pair_margin_max"] == 0.0
    assert (facts["integrator"], facts["cone"]) == ("mjINT_IMPLICITFAST", "mjCONE_ELLIPTIC")


def test_recording_has_stages_and_work() -> None:
    """Record a scene without trackers, with MuJoCo's own timers and counters."""
    recording = record(ENGINE, scene(FLOOR, free("ball", SHAPES["sphere"], R), duration=0.1), SETTINGS)
    assert recording.stage_names.tolist() == ["collision", "impulses", "integration"]
    assert recording.stage_seconds.sum() > 0
    assert recording.work[:, recording.work_names.tolist().index("contacts")].sum() > 0
    assert recording.facts["version"] == ENGINE.version() == mujoco.__version__


def test_warnings_are_kept_and_write_no_file(tmp_path, monkeypatch, capsys) -> None:
    """A warning of MuJoCo is in the output and the manifest; nothing is written where the user stands."""
    monkeypatch.chdir(tmp_path)
    world = ENGINE.build(scene(FLOOR, free("ball", SHAPES["sphere"], 1.0)), SETTINGS)
    assert world.describe().settings["warnings"] == "none"
    world._data.qvel[:] = np.nan
    world.step()
    assert "Nan, Inf or huge value in QVEL" in capsys.readouterr().err
    assert "badqvel 1" in world.describe().settings["warnings"]
    assert list(tmp_path.iterdir()) == []


def test_unsupported_is_said() -> None:
    """Raise Unsupported for friction below MuJoCo's least, for an unknown shape and for a profile."""
    ball = free("ball", SHAPES["sphere"], 1.0)
    with pytest.raises(Unsupported, match=r"mujoco: .*floor-ball"):
        ENGINE.build(scene(FLOOR, ball, mu=1e-6), SETTINGS)
    spec = mujoco.MjSpec()
    with pytest.raises(Unsupported, match="mujoco: no shape"):
        add_piece(spec, spec.worldbody, Piece("odd", object()), "odd")  # type: ignore[arg-type]
    with pytest.raises(Unsupported, match=r"mujoco: restitution must be 0 or above 0.02.*floor-ball"):
        ENGINE.build(scene(FLOOR, ball, e=0.01), ACCURATE)
    with pytest.raises(Unsupported, match="valid: recommended, equal-step, default, accurate, sleeping"):
        ENGINE.build(scene(FLOOR, ball), Settings("paper", DT))


def test_default_is_as_it_comes() -> None:
    """Leave integrator and cone as MuJoCo comes with them under the profile `default`."""
    scenario, plain = scene(FLOOR, free("ball", SHAPES["sphere"], 1.0)), mujoco.MjSpec().option
    facts = ENGINE.build(scenario, Settings("default", DT)).describe().settings
    assert facts["integrator"] == mujoco.mjtIntegrator(plain.integrator).name
    assert facts["cone"] == mujoco.mjtCone(plain.cone).name
    assert (facts["tolerance"], facts["impratio"]) == (plain.tolerance, plain.impratio)


SCENES = (
    *(("ball_snip", 400), ("table_slide", 400), ("collide_slips", 150), ("break_15", 150)),
    pytest.param("arms_cross", 1300, marks=pytest.mark.slow),
)
"""Hands, a collision, many balls, a person whose arms meet, each with the steps to play."""


def build(scenario: Scenario):
    """A world in which only what the plan has is simulated."""
    left = planned(scenario).applied(scenario, ("fixed",))
    return mujoco_engine.MujocoEngine().build(left, SETTINGS)


def steps(scenario: Scenario, count: int) -> Iterator[tuple]:
    """The state after each step, and every field of its contacts that the solver reads."""
    world = build(scenario)
    model, data = world._model, world._data
    for step in range(count):
        world.drive(step)
        world.step()
        contact = data.contact
        yield (
            np.concatenate((data.qpos, data.qvel)),
            # of bodies at a distance of 0 the broad phase lists some and the solver none
            *(np.array(getattr(contact, name))[contact.exclude == 0] for name in CONTACT),
        )
    yield (np.array([model.npair]),)


CONTACT = ("geom", "dist", "pos", "frame", "dim", "friction", "solref", "solreffriction", "solimp")


def played(scenario: Scenario, count: int) -> tuple[list[tuple], int]:
    """All steps, and the number of explicit pairs."""
    *rows, (pairs,) = steps(scenario, count)
    return rows, int(pairs[0])


@pytest.mark.parametrize(("name", "count"), SCENES)
def test_masks_give_the_contacts_of_explicit_pairs(name: str, count: int, monkeypatch) -> None:
    """Play the same states and contacts to the bit, in the same order, with the same coefficients."""
    scenario = catalogue()[name]
    masked, listed = played(scenario, count)
    assert listed == 0
    monkeypatch.setattr(mujoco_engine.MujocoEngine, "masks", False)
    paired, listed = played(scenario, count)
    assert listed > 0
    assert sum(len(row[1]) for row in paired) > 0
    for one, two in zip(masked, paired, strict=True):
        for first, second in zip(one, two, strict=True):
            np.testing.assert_array_equal(first, second)


def ball(name: str, kind: str = "simulated") -> Body:
    """A ball of a material of its own."""
    piece = (Piece("ball", Sphere(0.1)),)
    if kind == "fixed":
        return Body(name, "fixed", name, piece)
    return Body(name, "simulated", name, piece, 1.0, inertia=sphere_inertia(1.0, 0.1))


def balls(bodies: Iterable[Body], coefficients: dict[str, tuple[float, float]]) -> Scenario:
    """Balls a metre apart, with the (e, mu) of each pair of materials by their two letters."""
    bodies = tuple(replace(body, position=(float(k), 0.0, 0.0)) for k, body in enumerate(bodies))
    pairs = tuple(PairCoefficients(*names, e, mu) for names, (e, mu) in coefficients.items())
    return Scenario("test", "a test", (), bodies, 1.0, pairs)


def facts(scenario: Scenario) -> tuple[dict[str, tuple[float, float]], int]:
    """(e, mu) of each pair as read back from the model, and the number of explicit pairs."""
    world = mujoco_engine.MujocoEngine().build(scenario, SETTINGS)
    reported = {p.body_a + p.body_b: (p.restitution, p.friction) for p in world.describe().pairs}
    return reported, world._model.npair


def test_priorities_give_different_coefficients_to_different_pairs() -> None:
    """Give three materials two sets of coefficients without an explicit pair."""
    asked = {"aa": (0.1, 0.0), "ab": (0.5, 0.3), "ac": (0.5, 0.3), "bb": (0.1, 0.0), "bc": (0.2, 0.8)}
    reported, listed = facts(balls((ball("a"), ball("b"), ball("c")), asked | {"cc": (0.2, 0.8)}))
    assert listed == 0
    for pair in ("ab", "ac", "bc"):
        assert reported[pair] == pytest.approx(asked[pair], abs=1e-12)


def test_explicit_pairs_are_the_exception() -> None:
    """List the fewest pairs where no priorities give all coefficients, and give every pair its own."""
    asked = {"ab": (0.1, 0.1), "ac": (0.2, 0.2), "bc": (0.3, 0.3), "ad": (0.4, 0.4), "bd": (0.5, 0.5)}
    asked |= {"cd": (0.6, 0.6)} | {x + x: (0.0, 0.0) for x in "abcd"}
    scenario = balls((ball("a"), ball("b"), ball("c"), ball("d")), asked)
    reported, listed = facts(scenario)
    assert 0 < listed < len(reported)
    for pair, found in reported.items():
        assert found == pytest.approx(asked[pair], abs=1e-12)


@pytest.mark.parametrize("name", sorted(name for name, one in catalogue().items() if "large" not in one.tags))
def test_masks_allow_touching_pairs_and_no_others(name: str) -> None:
    """Let exactly the touching pairs of every scene collide, after masks, exclusions and explicit pairs."""
    scenario = planned(catalogue()[name]).applied(catalogue()[name], ("fixed",))
    found = contact_filter(scenario)
    allowed = set(found.explicit)
    for a, b in combinations(sorted(found.geoms), 2):
        one, two = found.geoms[a], found.geoms[b]
        if one.contype & two.conaffinity or two.contype & one.conaffinity:
            allowed.add((a, b))
    assert allowed - set(found.excluded) == set(scenario.touching_pairs())
    # no priority chooses the product of two coefficients
    assert not found.explicit or name == "normal_impacts"
    for a, b in allowed - set(found.excluded) - set(found.explicit):
        one, two = found.geoms[a], found.geoms[b]
        chosen = one if one.priority >= two.priority else two
        assert chosen.coefficients == scenario.pair_coefficients(a, b)
        assert one.priority != two.priority or one.coefficients == two.coefficients
