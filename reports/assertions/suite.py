"""Our invariants over all scenes of a tag and all engines asked for: `--touchstone-tag` collects this module.

A scene has a test for each invariant that applies to it: by its tags and its bodies, not by what an engine
does. A known failing of one of our engines is expected to fail, with its reason.
"""

from __future__ import annotations

from collections.abc import Callable

import pytest

import touchstone
from touchstone.adapters.recording import Recording
from touchstone.reports.assertions.invariants import INVARIANTS, ORDER_TOLERANCE, check, reordered
from touchstone.reports.assertions.outcome import InvariantError
from touchstone.reports.results import Row
from touchstone.reports.verdict.failings import failing_of
from touchstone.scenarios.catalogue import tagged
from touchstone.scenarios.scenario import Scenario, Sphere

Play = Callable[..., Recording]
REPEATED = 1.0
"""Duration up to which a scene is played twice, for determinism and for the order of bodies [s]."""


def applies(invariant: str, scenario: Scenario) -> bool:
    """Whether an invariant is a law of a scene, whatever an engine does with it."""
    tags = set(scenario.tags)
    free = [body for body in scenario.bodies if body.kind == "simulated"]
    pairs = list(scenario.touching_pairs())
    match invariant:
        case "momentum_kept":
            return "isolated" in tags
        case "heading_independent":
            return "headings" in tags
        case "restitution":
            balls = all(len(b.pieces) == 1 and isinstance(b.pieces[0].shape, Sphere) for b in free)
            return scenario.name.startswith("bounce_") and balls
        case "friction_cone":
            return bool(pairs) and "conservative" not in tags and "isolated" not in tags
        case "no_overlap" | "no_tunnelling":
            return bool(pairs)
        case "energy_not_created":
            return bool(free)
    return scenario.duration <= REPEATED and not scenario.trackers and len(free) > 1


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """A test for each scene of the tags and each invariant that applies to it."""
    tags = metafunc.config.getoption("--touchstone-tag")
    scenes = {one.name: one for tag in tags for one in tagged(tag)}
    pairs = [
        pytest.param(one, name, id=f"{one.name}-{name}")
        for one in scenes.values()
        for name in (*INVARIANTS, "deterministic", "order_independent")
        if applies(name, one)
    ]
    metafunc.parametrize(("scene", "invariant"), pairs)


def test_invariant(play: Play, engine: str, scene: Scenario, invariant: str) -> None:
    """An invariant holds in a scene."""
    run = play(scene, engine)
    try:
        if invariant == "deterministic":
            touchstone.assert_deterministic(run, play(scene, engine, again=1))
        elif invariant == "order_independent":
            touchstone.assert_order_independent(run, play(reordered(scene), engine), limit=ORDER_TOLERANCE)
        else:
            check(invariant, run, scene)
    except InvariantError as error:
        reasons = [_known(scene, run, finding.metric) for finding in error.findings if not finding.met]
        if reasons and all(reasons):
            pytest.xfail(f"known: {reasons[0]}")
        raise


def _known(scene: Scenario, run: Recording, metric: str) -> str:
    """Reason of a documented failing of one of our engines; "" if there is none."""
    facts = run.facts
    row = Row("assert", scene.name, facts["engine"], facts["profile"], float(facts["dt"]), metric)
    failing = failing_of(row)
    return failing.reason if failing else ""
