"""Builders that several test files share: small scenes, their worlds, and the depth of two pieces."""

import os
import shutil
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from dataclasses import replace as changed
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import typer
from hypothesis import HealthCheck
from hypothesis import settings as hypothesis_settings
from scipy.spatial.transform import Rotation
from session_cache import SessionCache

from touchstone.adapters.contract import CONTACT_FIELDS, Engine, Settings, Unsupported
from touchstone.adapters.engines.reference.compile_progress import announcement
from touchstone.adapters.engines.reference.compiling import compile_seconds
from touchstone.adapters.engines.reference.reference_world import piece_arrays, translate
from touchstone.adapters.engines.reference.settings import configure
from touchstone.adapters.recorder import record, scenario_json
from touchstone.adapters.recording import Recording, RunEnded
from touchstone.adapters.registry import ENGINES, installed, load, missing_reason
from touchstone.adapters.workers.process import THREADS
from touchstone.reference_impl.core import conventions
from touchstone.reference_impl.core.counters import COUNTERS
from touchstone.reference_impl.core.kernel_cache import CACHE_FOLDER
from touchstone.reference_impl.core.state_dtype import STATE
from touchstone.reference_impl.core.world import BODY, PAIR, World
from touchstone.reference_impl.frame import prepare, step
from touchstone.reference_impl.geometry.convex_depth import convex_depth
from touchstone.reference_impl.geometry.shapes import place_piece
from touchstone.reports.results import Row
from touchstone.reports.verdict.judge import judged, lost
from touchstone.reports.verdict.rows import measured
from touchstone.scenarios.avatar.avatar import Parts, avatar_parts, standing_tracker
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.files import named
from touchstone.scenarios.materials import TABLE_1
from touchstone.scenarios.scenario import (
    Body,
    Box,
    Hull,
    PairCoefficients,
    Piece,
    Scenario,
    Shape,
    Sphere,
    Tracker,
    Vector,
)
from touchstone.scenarios.solids import box_inertia, sphere_inertia

# on a loaded machine cases are drawn and tested slowly
hypothesis_settings.register_profile("fresh", deadline=None, suppress_health_check=[HealthCheck.too_slow])
hypothesis_settings.load_profile("fresh")
# `make test` draws the same cases every time; `make test-all` draws new ones
hypothesis_settings.register_profile("repeatable", hypothesis_settings.get_profile("fresh"), derandomize=True)

pytest_plugins = ["duration_budget", "forked_children", "owned_engine"]
FRAME = 1 / 60
FOLDER = "TOUCHSTONE_TEST_SESSION"
"""Environment variable with the folder that the workers of a test session share."""


def pytest_configure(config: pytest.Config) -> None:
    """Make the folder of the session, whose name workers inherit; they compute in one thread."""
    if not hasattr(config, "workerinput"):
        os.environ[FOLDER] = tempfile.mkdtemp(prefix="touchstone-tests-")
        os.environ.update(dict.fromkeys(THREADS, "1"))


def pytest_sessionstart(session: pytest.Session) -> None:
    """Compile the reference before workers start, where no run did: they would wait for each other."""
    config = session.config
    if getattr(config.option, "numprocesses", None) and not hasattr(config, "workerinput"):
        if note := announcement():
            print(note, flush=True)
        if CACHE_FOLDER is not None:
            compile_seconds()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark what plays DART, Bullet or MuJoCo: by a parameter's value or in the name of the file."""
    others = set(ENGINES) - {"reference"}
    for item in items:
        path, _, name = item.nodeid.partition("::")
        words = {*name.partition("[")[2].removesuffix("]").split("-"), *Path(path).stem.split("_")}
        if words & others:
            item.add_marker("engines")


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: object) -> object:
    """Let one worker run all tests of a scene of the catalogue, and of other tests those of a file."""
    from xdist.scheduler import LoadScopeScheduling

    class ByScene(LoadScopeScheduling):
        def _split_scope(self, nodeid: str) -> str:
            path, _, name = nodeid.partition("::")
            values = name.partition("[")[2].removesuffix("]").split("-")
            return next((value for value in values if value in catalogue()), path)

    return ByScene(config, log)


def pytest_unconfigure(config: pytest.Config) -> None:
    """Remove the folder of the session."""
    if not hasattr(config, "workerinput"):
        shutil.rmtree(os.environ.pop(FOLDER), ignore_errors=True)


@dataclass(frozen=True)
class Depth:
    """What the kernel says of two pieces."""

    distance: float
    normal: np.ndarray
    point_a: np.ndarray
    point_b: np.ndarray
    iterations: int
    converged: bool


def piece(shape: Shape, position: object = (0.0, 0.0, 0.0), turn: Rotation | None = None) -> Piece:
    """A piece in the world, turned by a scipy Rotation."""
    quaternion = (turn or Rotation.identity()).as_quat(scalar_first=True)
    return Piece("piece", shape, tuple(map(float, position)), tuple(quaternion.tolist()))


def corners(one: Piece) -> np.ndarray:
    """World vertices (n, 3) of a box or a hull."""
    match one.shape:
        case Box(half):
            signs = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
            local = signs * np.array(half)
        case Hull(vertices):
            local = np.array(vertices)
    return Rotation.from_quat(np.array(one.orientation), scalar_first=True).apply(local) + one.position


def measure(one: Piece, two: Piece) -> Depth:
    """Run `convex_depth` on two pieces."""
    bodies = np.zeros(2, BODY)
    bodies["rotation"] = np.eye(3)
    pieces, table = piece_arrays([(0, one), (1, two)])
    state, pairs = np.zeros(1, STATE), np.zeros(1, PAIR)
    for k in range(2):
        place_piece(pieces[k], bodies[k], table, 0.0)
    iterations, converged = convex_depth(pieces[0], pieces[1], table, state[0], pairs[0])
    row = pairs[0]
    return Depth(
        float(row["distance"]),
        row["normal"].copy(),
        row["point_a"].copy(),
        row["point_b"].copy(),
        iterations,
        bool(converged),
    )


def ball(name: str = "ball", position: Vector = (0.0, 0.0, 1.0), **fields: object) -> Body:
    """A wooden ball of 10 cm and 1 kg; `radius` and `mass` may be given."""
    radius, mass = float(fields.pop("radius", 0.05)), float(fields.pop("mass", 1.0))
    shape = Piece(name, Sphere(radius))
    inertia = sphere_inertia(mass, radius)
    return Body(name, "simulated", "wood", (shape,), mass=mass, inertia=inertia, position=position, **fields)


def block(name: str, half: Vector, position: Vector, kind: str = "simulated", **fields: object) -> Body:
    """A wooden box, of 1 kg unless it is fixed."""
    mass = 0.0 if kind == "fixed" else 1.0
    inertia = box_inertia(mass, half)
    return Body(
        name, kind, "wood", (Piece(name, Box(half)),), mass=mass, inertia=inertia, position=position, **fields
    )


def ground() -> Body:
    """A fixed slab whose surface is z = 0."""
    return block("ground", (20.0, 20.0, 0.5), (0.0, 0.0, -0.5), kind="fixed")


def still(root: str, position: Vector, end: Vector | None = None, duration: float = 1.0) -> Tracker:
    """A tracker that rests, or goes to `end`."""
    return Tracker(root, (), (0.0, duration), (position, end or position), ((1.0, 0, 0, 0),) * 2, ((), ()))


def scene(
    *bodies: Body, e: float = 0.0, mu: float = 0.0, laws: dict[str, float] | None = None, **fields: object
) -> Scenario:
    """A scene of wood, one second long unless told otherwise; `laws` are those of friction beyond mu."""
    duration, pairs = (
        float(fields.pop("duration", 1.0)),
        PairCoefficients("wood", "wood", e, mu, **(laws or {})),
    )
    return Scenario("test", "a test", (), bodies, duration, (pairs,), **fields)


def person(parts: Parts | None = None, **fields: object) -> Scenario:
    """The avatar, or other parts, standing alone with its root at the world's origin."""
    bodies, joints, chains = parts = parts or avatar_parts()
    tracker = standing_tracker(parts, (0.0, 0.0, 0.0), 1.0)
    fields = {"bodies": bodies, "joints": joints, "chains": chains, "trackers": (tracker,)} | fields
    return Scenario(name="person", summary="a test", tags=(), duration=1.0, coefficients=TABLE_1, **fields)


def build(scenario: Scenario, profile: str = "balanced", dt: float = FRAME, *changes: str) -> World:
    """A world ready for its first step; `changes` are settings ("key=value") besides the profile's."""
    world = translate(scenario)
    world.state["dt"], world.state["gravity"] = dt, scenario.acting_gravity
    configure(world.state[0], profile, changes)
    prepare(*world)
    return world


def play(world: World, frames: int, watch: Callable[[World], object] | None = None) -> list:
    """Step a world whose trackers rest; returns what `watch` saw after each frame."""
    seen = []
    for _ in range(frames):
        step(*world)
        if watch is not None:
            seen.append(watch(world))
    return seen


def scene_piece(world: World, index: int) -> Piece:
    """A box of a world where it is now, as a piece in the world."""
    row = world.pieces[index]
    body = world.bodies[row["body"]]
    turned = Rotation.from_quat(body["orientation"], scalar_first=True)
    return piece(Box(tuple(row["size"].tolist())), body["position"], turned)


def counters(world: World) -> dict[str, int]:
    """The counters of the last frame by name."""
    return dict(zip(COUNTERS, world.state[0]["counters"].tolist()))


def motion(world: World) -> tuple[np.ndarray, np.ndarray, float]:
    """Momentum, angular momentum about the origin, and kinetic energy of all simulated bodies."""
    rows = world.bodies[world.bodies["kind"] == conventions.SIMULATED]
    turned = rows["rotation"]
    spin = np.einsum("bij,bjk,blk,bl->bi", turned, rows["inertia"], turned, rows["omega"])
    linear = rows["mass"][:, None] * rows["velocity"]
    energy = (linear * rows["velocity"]).sum() / 2 + (spin * rows["omega"]).sum() / 2
    return linear.sum(0), (spin + np.cross(rows["center"], linear)).sum(0), float(energy)


@pytest.fixture(scope="session", autouse=True)
def commands_built_once() -> Iterator[None]:
    """Build the program's commands for its first call alone: that takes 0.04 s."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(typer.main, "get_command", cache(typer.main.get_command))
        yield


@pytest.fixture(autouse=True)
def engines_of_this_test() -> Iterator[None]:
    """Forget the engines that a test asked for by name: others play those of the start."""
    before = dict(ENGINES)
    yield
    for name in set(ENGINES) - set(before):
        del ENGINES[name]


@pytest.fixture(autouse=True)
def files_of_this_test(monkeypatch: pytest.MonkeyPatch) -> None:
    """Forget the scene files that a test reads: commands of other tests name scenes."""
    monkeypatch.setattr(named, "_FILES", {})


@pytest.fixture(scope="session")
def lab() -> SimpleNamespace:
    """The builders of this file."""
    builders = (piece, corners, measure, ball, block, ground, still, scene, person, build, play, counters)
    by_name = {one.__name__: one for one in (*builders, motion, scene_piece)}
    return SimpleNamespace(**by_name, frame=FRAME)


@cache
def shared() -> SessionCache:
    """What the workers of this session share."""
    return SessionCache(Path(os.environ[FOLDER]))


def engine(name: str) -> Engine:
    """The engine called `name`; skips where it is not installed."""
    if not installed(name):
        pytest.skip(f"{name}: {missing_reason(name)}")
    return load(name)


def settings(name: str, profile: str = "") -> Settings:
    """An engine's settings under a profile, or under the first it has."""
    chosen = profile or next(iter(ENGINES[name].profiles))
    return Settings(chosen, ENGINES[name].profiles[chosen])


def played_as(name: str, scenario: Scenario, settings: Settings) -> Recording:
    """A scene as an engine plays it, once a session; raises Unsupported or RunEnded as `record` does."""
    key = f"recording {name} {settings!r} {scenario_json(scenario)}"
    kind, reason, kept = shared().get(key, lambda: _outcome(engine(name), scenario, settings))
    if kind == "unsupported":
        raise Unsupported(reason)
    if kind == "ended":
        raise RunEnded(reason, kept)
    return kept


def _outcome(engine: Engine, scenario: Scenario, settings: Settings) -> tuple[str, str, Recording | None]:
    """How a run ended, why, and its recording; exceptions that hold recordings cannot be pickled."""
    try:
        return "done", "", record(engine, scenario, settings)
    except RunEnded as error:
        return "ended", str(error), error.recording
    except Unsupported as error:
        return "unsupported", str(error), None


def played(scenario: str, name: str, profile: str = "") -> Recording:
    """A scene of the catalogue as an engine plays it under a profile, or its first, once a session."""
    return played_as(name, catalogue()[scenario], settings(name, profile))


def saved(scenario: str, name: str) -> bytes:
    """The file of a recording of `played`, written once a session."""

    def write() -> bytes:
        with tempfile.TemporaryDirectory() as folder:
            played(scenario, name).save(Path(folder) / "run.npz")
            return (Path(folder) / "run.npz").read_bytes()

    return shared().get(f"file {name} {scenario}", write)


def judged_rows(scenario: str, name: str, profile: str = "") -> tuple[Row, ...]:
    """The judged rows of all metrics of the same, measured once a session."""
    scene, chosen = catalogue()[scenario], settings(name, profile)

    def measure_all() -> tuple[Row, ...]:
        base = Row("run", scenario, name, chosen.profile, chosen.dt, "run")
        rows = [judged(row, scene.tags) for row in measured(base, scene, played_as(name, scene, chosen))]
        return (*rows, *lost(base, rows))

    return shared().get(f"rows {name} {chosen!r} {scenario_json(scene)}", measure_all)


@pytest.fixture(scope="session")
def registry() -> SimpleNamespace:
    """Engines that skip when missing, their settings, and what they make of the catalogue's scenes."""
    return SimpleNamespace(
        engine=engine, settings=settings, played=played, saved=saved, judged_rows=judged_rows
    )


def recording(scenario: Scenario, dt: float = FRAME, **columns: object) -> Recording:
    """A recording in which every body stands still and nothing happens, but for the given columns."""
    frames, bodies = scenario.frame_count + 1, scenario.bodies
    still_at = Recording(
        scenario=scenario_json(scenario),
        manifest=f'{{"engine": "test", "profile": "default", "dt": {dt}}}',
        time=np.arange(frames) / scenario.frame_rate,
        position=np.tile([body.position for body in bodies], (frames, 1, 1)),
        orientation=np.tile([body.orientation for body in bodies], (frames, 1, 1)),
        linear_velocity=np.zeros((frames, len(bodies), 3)),
        angular_velocity=np.zeros((frames, len(bodies), 3)),
        joint_angle=np.zeros((frames, len(scenario.joints))),
        joint_rate=np.zeros((frames, len(scenario.joints))),
        driver_work=np.zeros(frames),
        driver_impulse=np.zeros((frames, len(scenario.trackers), 3)),
        contacts=np.zeros(0, CONTACT_FIELDS),
        time_frame=np.full(frames - 1, 1e-4),
        time_drive=np.full(frames - 1, 1e-5),
        time_read=np.full(frames - 1, 1e-5),
        time_crossing=np.full(5, 1e-6),
        stage_names=np.array([], dtype=str),
        stage_seconds=np.zeros((frames - 1, 0)),
        work_names=np.array([], dtype=str),
        work=np.zeros((frames - 1, 0)),
    )
    return changed(still_at, **columns)


def contacts(*rows: dict[str, object]) -> np.ndarray:
    """Contact rows of a recording; fields that are not given are zero."""
    table = np.zeros(len(rows), CONTACT_FIELDS)
    for row, given in zip(table, rows):
        for name, value in given.items():
            row[name] = value
    return table


@pytest.fixture(scope="session")
def recordings() -> SimpleNamespace:
    """Builders of recordings by hand."""
    return SimpleNamespace(recording=recording, contacts=contacts)
