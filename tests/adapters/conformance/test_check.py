"""Conformance: a sound engine has no fault, and each planted bug of an adapter is found and named."""

import re
import sys
from collections.abc import Iterator

import pytest

from touchstone.adapters.conformance import check as module
from touchstone.adapters.conformance.bench import Bench
from touchstone.adapters.conformance.check import CHECKS, check, checked
from touchstone.adapters.contract import AdapterError, Settings
from touchstone.adapters.registry import ACCURATE, ENGINES, Entry, installed, missing_reason

SETTINGS = Settings("default", 1 / 240)
PLANTED = {
    "mass": r"mass of 'wooden' is 1\.44 kg, asked 1\.2",
    "inertia about the origin": r"inertia of 'box' is taken about its origin",
    "coefficients exchanged": r"restitution and friction of floor-wooden are exchanged",
    "restitution": r"acts as 0\.5\d* and 0\.5\d*, asked 0\.2 and 0\.8: it does not follow what is asked",
    "gravity": r"gravity is \(0, 0, -4\.905\) m/s\^2, asked \(0, 0, -9\.81\)",
    "shared state": r"angular velocity of 'ball' is|worlds share a state|two runs of one scene differ",
    "step": r"a step advances by 0\.008333 s, asked 0\.004167 s",
    "stale contacts": r"contacts of earlier steps are still reported while the ball flies",
    "raises": r"ZeroDivisionError: division by zero in `step` \(.*planted\.py, line \d+\)",
    "damping": r"a ball in free flight keeps 0\.78\d\d of its speed in 24 steps: something damps it",
    "twice": r"contact 0 of pair floor-ball is reported twice",
    "normals": r"normals of pair floor-ball point from B to A",
    "impulses on A": r"impulses of pair floor-ball act on A",
    "forces": r"impulses of pair floor-ball are forces: multiply by the step",
    "distance": r"distance of pair floor-ball is positive in overlap",
    "full extents": r"overlaps by 101 mm, placed to overlap by 1 mm: check half and full extents",
    "B first": r"contacts of pair floor-ball name B first: A comes before B in the scene",
    "xyzw": r"orientation of 'ball' is xyzw; the contract wants wxyz",
    "inverse orientation": r"orientation of 'ball' is that of the world in the body",
    "mass centre's position": r"position of 'box' is that of its mass centre",
    "origin's velocity": r"linear velocity of 'box' is that of its origin",
    "body axes": r"angular velocity of 'ball' is along the body's axes",
    "order": r"bodies are read in another order than the scene's",
    "reads": r"reads change the state",
    "replaces": r"`read` replaces state\.position; write into it \(state\.position\[:\] = \.\.\.\)",
    "wrong shape": r"`read` replaces state\.position by one of shape \(1, 2\), expected \(1, 3\)",
    "not finite": r"linear_velocity is not finite in landing_ball",
    "random": r"two runs of one scene differ",
}
"""The fault that the checks must name, per bug."""


@pytest.fixture(scope="module")
def faults(planted):
    """Faults of an engine with a bug, check by check, and what it refused."""

    def find(bug: str = "") -> Iterator[tuple[tuple[str, ...], str]]:
        planted.Sound.kept.clear()
        for one in CHECKS.values():
            yield checked(one, Bench(planted.Engine(bug), SETTINGS))

    return find


def test_a_sound_engine_has_no_fault(faults):
    """The engine without a bug passes all checks; what it refuses is not checked."""
    found = list(faults())
    assert [reported for reported, _ in found if reported] == []
    assert {refused for _, refused in found} == {"", "planted: no driven bodies"}


@pytest.mark.parametrize("bug", PLANTED)
def test_each_planted_bug_is_named(faults, bug):
    """Each bug is found, and said in words."""
    assert any(re.search(PLANTED[bug], fault) for found, _ in faults(bug) for fault in found)


@pytest.mark.parametrize("name", ENGINES)
def test_our_adapters_conform(registry, name):
    """Every check in this process: MuJoCo's contacts of `recommended` hop, so that friction acts less."""
    bench = Bench(registry.engine(name), registry.settings(name, ACCURATE if name == "mujoco" else ""))
    assert {one: checked(CHECKS[one], bench) for one in CHECKS} == dict.fromkeys(CHECKS, ((), ""))


KNOWN_FAULTS = {
    # contacts have the friction asked, but the ball hops by 9 mm, so that 3 of 38 steps have one: the cause
    # `lift` of the known failings; with `accurate`, above, it hops by 0.03 mm
    "mujoco": [("coefficients", r"friction of pair wooden-floor acts as 0\.\d+, asked 0\.5")],
}
"""Checks that an engine fails under its first profile, and the fault of each."""


@pytest.mark.slow
@pytest.mark.parametrize("name", ENGINES)
def test_our_engines_conform(name):
    """The adapters of this project have no fault but those known."""
    if not installed(name):
        pytest.skip(missing_reason(name))
    found = [(report.check, fault) for report in check(name) for fault in report.faults]
    known = KNOWN_FAULTS.get(name, [])
    assert [one for one, _ in found] == [one for one, _ in known], found
    assert all(re.fullmatch(text, fault) for (_, fault), (_, text) in zip(found, known)), found


CRASH = """
import os, time

class Crash:
    name, profiles = "crash", {"default": 1 / 240}

    def version(self):
        return "1"

    def build(self, scenario, settings):
        if scenario.name == "meeting_balls":
            os._exit(9)
        if scenario.name == "bouncing_ball":
            time.sleep(60)
        raise RuntimeError("nothing else works")


class Hang(Crash):
    name = "hang"

    def build(self, scenario, settings):
        time.sleep(60)
"""


@pytest.mark.slow
def test_a_crash_and_a_hang_end_one_check(monkeypatch, tmp_path):
    """A check that ends its process or does not answer is named; the others still run."""
    (tmp_path / "crash_engine.py").write_text(CRASH)
    monkeypatch.setattr(sys, "path", [*sys.path, str(tmp_path)])
    monkeypatch.setitem(ENGINES, "crash", Entry("crash_engine:Crash", "crash_engine", {"default": 1 / 240}))
    monkeypatch.setattr(module, "CHECKS", {name: CHECKS[name] for name in ("order", "bounce", "step")})
    monkeypatch.setattr(module, "LOAD_PATIENCE", 3.0)
    found = {report.check: report.faults for report in check("crash", patience=3.0)}
    assert found["order"] == ("died in the check 'order': exit code 9",)
    assert found["bounce"] == ("hung: no answer in the check 'bounce' for 3 s",)
    assert re.match(r".*nothing else works in `build` \(.*crash_engine.py, line 15\)", found["step"][0])
    monkeypatch.setitem(ENGINES, "hang", Entry("crash_engine:Hang", "crash_engine", {"default": 1 / 240}))
    reports = list(check("hang", patience=1.0))
    assert [bool(report.faults) for report in reports] == [True, True, False]
    assert reports[2].skipped == "the engine hung in the checks 'order' and 'bounce'"


EMPTY = """
class Empty:
    name, profiles = "empty", {"default": 1 / 240}

    def version(self):
        return "1"

    def build(self, scenario, settings):
        return object()
"""


def test_a_world_without_methods_is_told_once(monkeypatch, tmp_path):
    """The methods that it lacks are named in the first check; the others refer to it."""
    (tmp_path / "empty_engine.py").write_text(EMPTY)
    monkeypatch.setattr(sys, "path", [*sys.path, str(tmp_path)])
    monkeypatch.setitem(ENGINES, "empty", Entry("empty_engine:Empty", "empty_engine", {"default": 1 / 240}))
    first, *others = check("empty")
    lacks = "drive, step, read, describe, cross, stage_seconds, work, close"
    assert first.faults == (f"`build` returns object, which lacks {lacks}",)
    assert [(one.faults, one.skipped) for one in others] == [((), "as in the check 'manifest'")] * len(others)


def test_an_unknown_profile_is_refused():
    """The valid profiles are named."""
    with pytest.raises(AdapterError, match="reference: no profile 'best'; valid: balanced, paper, accurate"):
        list(check("reference", "best"))
