"""Scripts in an engine's own API print what the adapter records; lines of settings are those of scripts."""

import re
from contextlib import redirect_stdout
from dataclasses import replace
from io import StringIO
from runpy import run_path

import pytest

from touchstone.adapters.contract import AdapterError, Settings
from touchstone.adapters.recorder import record
from touchstone.adapters.registry import ENGINES, installed, profiles_of, registered, settings_of
from touchstone.adapters.scripts.process import distance, run, settings_lines, written
from touchstone.adapters.scripts.script import MOST_LINES, literal
from touchstone.adapters.workers.play import play
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.scenario import Box, Capsule, Hull, Sphere

pytestmark = pytest.mark.usefixtures("forked")

ROUNDING = 1e-12
"""Difference of origins that were computed from centres of mass in another order [m]."""
CASES = [
    # engine, profile, scene, what it has
    *((engine, "default", "bounce_e05") for engine in ("mujoco", "bullet", "dart")),
    *(
        (engine, "recommended", scene)
        for engine in ("mujoco", "bullet", "dart")
        for scene in ("slide", "slip")
    ),
    *((engine, "accurate", "stack") for engine in ("mujoco", "bullet")),
    *((engine, "recommended", "prism_rolls") for engine in ("mujoco", "bullet", "dart")),
    *((engine, "recommended", "capsules") for engine in ("mujoco", "bullet", "dart")),
    *((engine, "recommended", "press") for engine in ("mujoco", "bullet")),
    ("mujoco", "recommended", "slap_3"),
    ("mujoco", "recommended", "belt"),
    ("bullet", "maximal", "slip"),
    *(("drake", "recommended", scene) for scene in ("stack", "coin_rolls", "bounce_e0")),
    *(("drake", "default", scene) for scene in ("slide", "press")),
    ("drake", "sap", "tip_holds"),
    ("drake", "cenic", "incline_slides"),
]


def settings(engine, profile, dt=None, *changes):
    return Settings(profile, dt or profiles_of(engine)[profile], changes)


def needs(engine):
    if not installed(engine):
        pytest.skip(f"{engine} is not installed")


def capsules():
    """Capsules that slide and turn over a table: no scene of the catalogue has any."""
    scene, one = catalogue()["slip"], Capsule(0.05, 0.1)
    bodies = tuple(
        body if body.kind == "fixed" else replace(body, pieces=(replace(body.pieces[0], shape=one),))
        for body in scene.bodies
    )
    return replace(scene, name="capsules", bodies=bodies, truths=(), expectations=(), forces=())


def scene_of(name):
    return capsules() if name == "capsules" else catalogue()[name]


def test_cases_have_every_shape():
    """Spheres, boxes, capsules and hulls, restitution, friction and driven bodies are among the cases."""
    scenes = [scene_of(scene) for _, _, scene in CASES]
    shapes = {type(piece.shape) for scene in scenes for body in scene.bodies for piece in body.pieces}
    assert shapes >= {Sphere, Box, Hull, Capsule}
    assert any(scene.trackers for scene in scenes)
    pairs = [scene.pair_coefficients(*pair) for scene in scenes for pair in scene.touching_pairs()]
    assert any(e > 0 for e, _ in pairs)
    assert any(mu > 0 for _, mu in pairs)


def run_here(path):
    """What a script prints, in this process."""
    with redirect_stdout(StringIO()) as printed:
        run_path(str(path))
    return printed.getvalue()


@pytest.mark.slow
@pytest.mark.parametrize(("engine", "profile", "scene"), CASES)
def test_a_script_prints_the_recording(registry, engine, profile, scene, tmp_path):
    """At most 60 lines without our packages repeat positions to the bit, or to rounding from mass centres."""
    needs(engine)
    scenario, own = scene_of(scene), settings(registered(engine), profile)
    script = written(scenario, engine, own)
    lines = script.text.splitlines()
    assert len(lines) <= MOST_LINES
    imported = [line for line in lines if re.match(r"(from|import) ", line)]
    assert not any("touchstone" in line for line in imported)
    path = tmp_path / "script.py"
    path.write_text(script.text)
    recording = record(registry.engine(engine), scenario, own)
    # a script of Bullet has the first client of its process
    printed = run(path) if engine == "bullet" else run_here(path)
    apart = distance(printed, recording, scenario, script.of_mass)
    assert apart <= (ROUNDING if script.of_mass else 0.0)


@pytest.mark.parametrize("engine", ["mujoco", "bullet", "dart"])
def test_names_of_scripts_may_hold_any_character(registry, engine, tmp_path):
    """Quotes, backslashes, braces and markup in the names of scene and bodies are printed as they are."""
    needs(engine)
    scene, odd = catalogue()["bounce_e05"], "\\\\ \\n \"\"\" ''' {0} <a&b> %s"
    bodies = tuple(replace(body, name=f"{odd}{k}") for k, body in enumerate(scene.bodies))
    scene = replace(scene, name=odd, summary=odd, bodies=bodies, truths=(), expectations=(), forces=())
    own, path = settings(engine, "default"), tmp_path / "script.py"
    script = written(scene, engine, own)
    path.write_text(script.text)
    apart = distance(run(path), record(registry.engine(engine), scene, own), scene, script.of_mass)
    assert apart <= ROUNDING


def test_a_script_of_another_step_differs(tmp_path):
    """The comparison sees a script that plays something else."""
    needs("mujoco")
    scenario, path = catalogue()["bounce_e05"], tmp_path / "script.py"
    script = written(scenario, "mujoco", settings("mujoco", "default", 1 / 240))
    path.write_text(script.text)
    recording = play(scenario, [("mujoco", "default")])["mujoco", "default"].recording
    assert distance(run(path), recording, scenario, script.of_mass) > 1e-6


@pytest.mark.parametrize(
    ("engine", "change"),
    [
        ("mujoco", "impratio=3"),
        ("bullet", "contactERP=0.05"),
        ("dart", "split_impulse=on"),
        ("drake", "resolution_hint=0.01"),
        ("drake", "stiction_tolerance=0.001"),
    ],
)
def test_lines_of_settings_are_those_of_the_script(engine, change):
    """Each line to paste is in the script of the same settings, wherever lines break."""
    needs(engine)
    profile = next(iter(profiles_of(registered(engine))))
    assert settings_of(engine).changes(profile, (change,)) == (change if "=on" in change else _plain(change),)
    own, scenario = settings(engine, profile, None, change), catalogue()["slide"]
    (pasted,) = settings_lines(scenario, engine, [own])
    text = _unwrapped(written(scenario, engine, own).text)
    whole = _unwrapped("\n".join(pasted))
    assert pasted
    assert whole != _unwrapped("\n".join(settings_lines(scenario, engine, [replace(own, changes=())])[0]))
    for statement in re.split(
        r"(?<=[)>\w]) (?=p\.|<|world|deactivation|plant|scene_graph|Add|\w+ = )", whole
    ):
        assert statement.strip() in text


def _plain(change):
    key, _, value = change.partition("=")
    return f"{key}={float(value)}"


def _unwrapped(text):
    return re.sub(r"\s+", " ", text.replace("; ", " "))


@pytest.mark.parametrize(
    ("engine", "scene", "said"),
    [
        ("reference", "fall", "reference: no scripts in its own API are written for it; for dart, bullet"),
        ("newton", "fall", "newton: no scripts in its own API are written for it"),
        ("drake", "slap_3", "drake: no script is written for driven bodies with hinges"),
        ("bullet", "ball_snip", "a script of ball_snip would have"),
        ("bullet", "ellipsoid_rocks", "bullet: pybullet makes no ellipsoids"),
    ],
)
def test_what_has_no_script_is_refused_by_name(engine, scene, said):
    """Engines without scripts, scenes with too many different bodies, and shapes that an engine lacks."""
    if engine not in ("reference", "newton"):
        needs(engine)
    name = registered(engine)
    with pytest.raises(AdapterError, match=re.escape(said)):
        written(catalogue()[scene], name, settings(name, next(iter(ENGINES[name].profiles))))


def test_numbers_keep_all_digits():
    """Literals read back as the same numbers, infinite ones too."""
    values = (0.1 + 0.2, [1, -0.0, float("inf")], ("a",))
    assert repr(eval(literal(values))) == repr(values)
