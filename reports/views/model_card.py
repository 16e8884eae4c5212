"""The model card: a scene's driven bodies in every engine, checked by pinocchio as the referee.

All figures are read back from a world that an engine built, at the scene's start; the referee computes its
own from the scene. Deviations are relative to the referee's mass, size or inertia.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import Array
from touchstone.adapters.oracles.articulated import Articulated
from touchstone.adapters.recording import Recording
from touchstone.adapters.registry import ENGINES
from touchstone.adapters.workers.play import play
from touchstone.scenarios.avatar.tracking import sample
from touchstone.scenarios.scenario import Scenario, Tracker

AGREED = 1e-9
"""Deviation up to which an engine's model matches the scene [1]: rounding of some thirty links."""
REFEREE = "pinocchio"


class NotDriven(ValueError):
    """A scene without driven bodies has no card; the message says so."""


def card_rows(scenario: Scenario, file: Path | None = None) -> list[dict[str, object]]:
    """A row per driven body and engine, the referee's first; then one of the robot's file, if it is given.

    Raises:
        NotDriven: the scene has no driven bodies.
        RobotError: the file is no robot.
    """
    driven = _driven(scenario)
    if not driven:
        robots = "robots have them if imported without --free"
        raise NotDriven(f"{scenario.name}: no driven bodies, so no model card; {robots}")
    held, reasons = _held(scenario)
    rows: list[dict[str, object]] = []
    for tracker in driven:
        rows.append(_row(REFEREE, tracker, scenario, _referee(scenario, tracker), "", "the scene itself"))
        for engine, recording in held.items():
            whole = _whole(scenario, tracker, recording)
            off = deviation(scenario, tracker, recording)
            found = ("agrees" if off <= AGREED else "differs", ENGINES[engine].rounding)
            row = _row(engine, tracker, scenario, whole, f"{off:.1e}", "; ".join(filter(None, found)))
            facts = recording.facts
            links = [scenario.bodies[k].name for k in scenario.links(tracker)]
            row |= {"pieces": sum(facts["pieces"][name] for name in links), "freedom": facts["freedom"]}
            rows.append(row)
        blank: dict[str, object] = dict.fromkeys(rows[0], "")
        rows += [blank | {"body": tracker.root, "model": e, "remark": r} for e, r in reasons.items()]
    return [*rows, _file_row(scenario, file, rows[0])] if file is not None else rows


def _file_row(scenario: Scenario, file: Path, first: Mapping[str, object]) -> dict[str, object]:
    """What an independent reader has of the robot's file, beside the scene that was imported from it."""
    from touchstone.adapters.oracles.robot_file import READERS, deviations, trees_of
    from touchstone.adapters.robots.robot_scene import imported
    from touchstone.adapters.robots.source import compiled

    source = compiled(file, allow_paths=True)
    trees = trees_of(file, source, scenario)
    noted = replace(imported(file, scenario.name, allow_paths=True), scenario=scenario)
    off = deviations(noted, trees)
    apart = [f"{name} by {value:.1e}" for name, value in off.items() if value > AGREED]
    found: dict[str, object] = {
        "body": first["body"],
        "model": f"{file.name} ({READERS[source.form]})",
        "mass [kg]": f"{sum(tree.whole({}).mass for tree in trees):.6g}",
        "hinges": sum(len(tree.hinges) for tree in trees),
        "deviation": f"{max(off.values()):.1e}",
        "remark": f"the scene differs: {', '.join(apart)}" if apart else "the scene agrees",
    }
    return dict.fromkeys(first, "") | found


def _driven(scenario: Scenario) -> list[Tracker]:
    return [tracker for tracker in scenario.trackers if not scenario.prescribes(tracker)]


def _row(
    model: str, tracker: Tracker, scenario: Scenario, whole: tuple[float, Array, Array], off: str, remark: str
) -> dict[str, object]:
    mass, center, inertia = whole
    free = sum(6 for body in scenario.bodies if body.kind == "simulated")
    return {
        "body": tracker.root,
        "model": model,
        "mass [kg]": f"{mass:.6g}",
        "centre [m]": " ".join(f"{value:.4f}" for value in center),
        "inertia [kg m^2]": " ".join(f"{value:.4g}" for value in np.linalg.eigvalsh(inertia)),
        "freedom": free + sum(6 + len(t.joints) for t in _driven(scenario)),
        "hinges": len(tracker.joints),
        "pieces": sum(len(scenario.bodies[k].pieces) for k in scenario.links(tracker)),
        "deviation": off,
        "remark": remark,
    }


def deviation(scenario: Scenario, tracker: Tracker, recording: Recording) -> float:
    """Largest deviation of an engine from the referee and the scene, over mass, centre, inertia and limits
    [1]; infinite where the numbers of degrees of freedom, hinges or pieces differ."""
    facts = recording.facts
    mass, center, inertia = _referee(scenario, tracker)
    own_mass, own_center, own_inertia = _whole(scenario, tracker, recording)
    size = np.sqrt(np.trace(inertia) / mass)
    by_name = {joint.name: joint for joint in scenario.joints}
    off = [abs(own_mass - mass) / mass, np.abs(own_center - center).max() / size]
    off.append(np.abs(own_inertia - inertia).max() / np.abs(inertia).max())
    for name in tracker.joints:
        if name not in facts["limits"]:
            return float("inf")
        low, high = facts["limits"][name]
        off += [abs(low - by_name[name].lower), abs(high - by_name[name].upper)]
    links = [scenario.bodies[k] for k in scenario.links(tracker)]
    counts = [facts["pieces"][link.name] == len(link.pieces) for link in links]
    moving = sum(body.kind == "simulated" for body in scenario.bodies)
    freedom = 6 * moving + sum(6 + len(t.joints) for t in _driven(scenario))
    return float(max(off)) if all(counts) and facts["freedom"] == freedom else float("inf")


def _referee(scenario: Scenario, tracker: Tracker) -> tuple[float, Array, Array]:
    start = sample(tracker, np.zeros(1))
    model = Articulated(scenario, tracker)
    return model.body(model.posture(start.position[0], start.orientation[0], start.angle[0]))


def _whole(scenario: Scenario, tracker: Tracker, recording: Recording) -> tuple[float, Array, Array]:
    """Mass, centre of mass and inertia about it of all links, in an engine's first reported state."""
    links, bodies = scenario.links(tracker), recording.facts["bodies"]
    facts = [bodies[scenario.bodies[k].name] for k in links]
    turned = Rotation.from_quat(recording.orientation[0][list(links)], scalar_first=True).as_matrix()
    masses = np.array([fact["mass"] for fact in facts])
    local = np.array([fact["center_of_mass"] for fact in facts])
    centers = recording.position[0][list(links)] + np.einsum("kij,kj->ki", turned, local)
    center = masses @ centers / masses.sum()
    arms = centers - center
    own = turned @ np.array([fact["inertia"] for fact in facts]) @ turned.transpose(0, 2, 1)
    shifted = (arms * arms).sum(axis=1)[:, None, None] * np.eye(3) - arms[:, :, None] * arms[:, None, :]
    return float(masses.sum()), center, (own + masses[:, None, None] * shifted).sum(axis=0)


def _held(scenario: Scenario) -> tuple[Mapping[str, Recording], Mapping[str, str]]:
    """A recording of one frame per engine, and the reasons why others failed."""
    short = replace(scenario, duration=1 / scenario.frame_rate, expectations=(), truths=(), forces=())
    runs = {engine: run for (engine, _), run in play(short).items()}
    held = {engine: run.recording for engine, run in runs.items() if run.status == "done" and run.recording}
    return held, {engine: run.reason for engine, run in runs.items() if engine not in held}
