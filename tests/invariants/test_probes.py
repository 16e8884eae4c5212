"""Every engine over every probe and gallery scene: all metrics against the limits table."""

from collections.abc import Iterable
from itertools import product

import numpy as np
import pytest
from same_recording import SHORT, different

from touchstone.adapters.contract import Unsupported
from touchstone.adapters.recorder import record
from touchstone.adapters.recording import RunEnded
from touchstone.adapters.registry import ENGINES
from touchstone.reports.metrics import METRICS
from touchstone.reports.metrics.motion.events import subjects
from touchstone.reports.results import Row
from touchstone.reports.verdict.failings import known
from touchstone.scenarios.catalogue import catalogue, tagged

PROBES = [scenario.name for scenario in tagged("probe")]
GALLERY = [scenario.name for scenario in tagged("gallery")]
USUAL = ("ball_snip",)
"""A hand's scene: what other engines than the reference play, but in slow tests."""
SEEDED = [scenario.name for scenario in tagged("seeded")]
HEAPED = 60
"""Bodies from which a scene takes 5 s and more: slow tests play it."""
BESIDE = [
    # slow tests play mechanisms too, whose closed forms have tests of their own
    pytest.param(name, marks=pytest.mark.slow if scene.body_joints or len(scene.bodies) >= HEAPED else ())
    for name, scene in catalogue().items()
    if name not in PROBES + SEEDED + GALLERY
]
"""Scenes that are neither probes nor of the gallery."""
LAWS = (
    "momentum.linear",
    "momentum.angular",
    "energy.injected",
    "friction.cone",
    "restitution.error",
    "overlap.max",
)
"""Laws that no engine may break unawares."""
FIRST = {engine: next(iter(entry.profiles)) for engine, entry in ENGINES.items()}
OTHERS = [
    (engine, profile)
    for engine, entry in ENGINES.items()
    for profile in entry.profiles
    # our equal-step is `balanced` at 1/240 s and serves the clock: its failings are not documented
    if profile != FIRST[engine] and (engine, profile) != ("reference", "equal-step")
]
ENDED = {one.key[:3] for one in known().values() if one.metric == "run"}
"""(engine, profile, scene) of runs that end before their scene does: known failings of the metric `run`."""

HEAVY = {
    ("dart", FIRST["dart"]): ("tower_40", "pyramid", "brick_wall", "arch_thin", "tower_20_jittered"),
    ("reference", "paper"): ("tower_", "arch_", "pyramid", "brick_wall", "dominoes"),
}
"""Beginnings of the names of scenes that take 5 to 30 s each: slow tests play them. Lighter scenes of these
kinds remain."""
SLOW = ("bullet", "dart")
"""Engines whose probes slow tests play."""


def judged_scenes(columns: Iterable[tuple[str, str]]) -> list:
    """(engine, profile, scene) of all probes; marks those whose run ends early, and slow ones: other profiles
    of other engines too."""
    ends = pytest.mark.xfail(reason="the run ends before its scene does", raises=RunEnded, strict=True)
    found = []
    for (engine, profile), scene in product(columns, PROBES):
        marks = [ends] if (engine, profile, scene) in ENDED else []
        heavy = scene.startswith(HEAVY.get((engine, profile), ()))
        if engine in SLOW or heavy or (engine != "reference" and profile != FIRST[engine]):
            marks.append(pytest.mark.slow)
        found.append(pytest.param(engine, profile, scene, marks=marks))
    return found


PLAYED = [
    (engine, profile, scene)
    if engine == "reference" or scene in USUAL
    else pytest.param(engine, profile, scene, marks=pytest.mark.slow)
    for engine, profile in FIRST.items()
    for scene in GALLERY
]
"""The gallery on each engine, under its first profile."""
FIRST_PROFILES = [*judged_scenes(FIRST.items()), *PLAYED]


@pytest.fixture(scope="module")
def rows(registry):
    """The judged rows of a probe."""

    def build(engine: str, profile: str, scene: str) -> tuple[Row, ...]:
        try:
            return registry.judged_rows(scene, engine, profile)
        except Unsupported as reason:
            pytest.skip(str(reason))

    return build


@pytest.fixture(scope="module")
def broken(rows):
    """What broke a limit, or mended a known failing, or could not be measured for an error."""

    def build(engine: str, profile: str, scene: str) -> list[str]:
        return [
            f"{row.metric} {row.subject} {row.value:g}, limit {row.limit:g}: {row.reason}"
            for row in rows(engine, profile, scene)
            if row.verdict in ("fail", "error")
        ]

    return build


@pytest.mark.parametrize(("engine", "profile", "scene"), [*FIRST_PROFILES, *judged_scenes(OTHERS)])
def test_no_limit_is_broken(broken, engine, profile, scene):
    """Under each of its profiles an engine meets every limit of a probe, or fails as it is known to."""
    assert broken(engine, profile, scene) == []


@pytest.mark.parametrize("scene", BESIDE)
def test_the_reference_meets_limits_elsewhere(broken, scene):
    """The reference meets every limit of the other scenes, or fails as it is known to."""
    assert broken("reference", "balanced", scene) == []


@pytest.mark.parametrize(("engine", "profile", "scene"), PLAYED)
def test_what_is_expected_happens(rows, engine, profile, scene):
    """Every expected event has its own row, happened within its window, and passes, or is known not to."""
    events = {(row.metric, row.subject): row for row in rows(engine, profile, scene)}
    expectations = subjects(catalogue()[scene])
    assert expectations
    for (event, subject), e in expectations.items():
        row = events[f"events.{event}", subject]
        if row.verdict == "known":  # a documented failing keeps it from happening
            continue
        assert e.earliest <= row.value <= e.latest
        assert (row.verdict, row.low, row.high) == ("pass", e.earliest, e.latest)


@pytest.mark.parametrize(("engine", "profile", "scene"), PLAYED)
def test_states_stay_sane(registry, engine, profile, scene):
    """States are finite, quaternions are unit, and fixed bodies stay where they are."""
    recording, scenario = registry.played(scene, engine, profile), catalogue()[scene]
    for name in ("position", "linear_velocity", "angular_velocity", "joint_angle", "joint_rate"):
        assert np.isfinite(getattr(recording, name)).all(), name
    # rounding; Bullet normalises once a step
    assert np.linalg.norm(recording.orientation, axis=2) == pytest.approx(1.0, abs=1e-9)
    for k, body in enumerate(scenario.bodies):
        if body.kind == "fixed":
            assert np.ptp(recording.position[:, k], axis=0).max() == 0
            assert (recording.linear_velocity[:, k] == 0).all()


REPEATED = [
    pytest.param(one.name, marks=pytest.mark.slow) if "heap" in one.tags else one.name
    for one in catalogue().values()
    if one.name not in SHORT
]
"""Scenes that are played twice here: `test_plan_and_all_effects_are_one` plays all others a second time."""


@pytest.mark.parametrize("scene", REPEATED)
def test_the_reference_repeats_to_the_bit(registry, scene):
    """Two runs of the reference leave the same recording, but for what the clock says."""
    again = record(registry.engine("reference"), catalogue()[scene], registry.settings("reference"))
    assert different(registry.played(scene, "reference"), again) == set()


@pytest.mark.slow
@pytest.mark.parametrize("scene", [*BESIDE, *GALLERY])
def test_the_accurate_profile_meets_limits_elsewhere(broken, scene):
    """So does its profile `accurate`."""
    assert broken("reference", "accurate", scene) == []


@pytest.mark.slow
@pytest.mark.parametrize("scene", SEEDED)
@pytest.mark.parametrize("profile", ["balanced", "accurate"])
def test_no_heading_or_speed_is_special(broken, profile, scene):
    """The reference meets the limits at headings, speeds, spins and frictions by chance."""
    assert broken("reference", profile, scene) == []


@pytest.mark.parametrize(("engine", "profile", "scene"), FIRST_PROFILES)
def test_every_metric_leaves_a_judged_row(rows, engine, profile, scene):
    """Each metric has a value or a reason why not, and every law that was measured a verdict."""
    found = rows(engine, profile, scene)
    assert {row.metric for row in found} == set(METRICS)
    assert all(np.isfinite(row.value) or row.reason for row in found)
    verdicts = {row.verdict for row in found if row.metric in LAWS and np.isfinite(row.value)}
    assert verdicts <= {"pass", "known", "fail"}


@pytest.mark.parametrize(
    "engine", [pytest.param(one, marks=pytest.mark.slow) if one in SLOW else one for one in ENGINES]
)
def test_every_law_is_measured_somewhere(rows, engine):
    """No law is skipped in all probes, nor known to be broken wherever it applies."""
    heavy = HEAVY.get((engine, FIRST[engine]), ())
    light = [scene for scene in PROBES if not scene.startswith(heavy)]
    passed = [r.metric for scene in light for r in rows(engine, FIRST[engine], scene) if r.verdict == "pass"]
    assert all(passed.count(law) >= 2 for law in LAWS)
