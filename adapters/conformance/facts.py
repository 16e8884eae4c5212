"""Checks of manifests: masses, mass centres, inertias, coefficients, names and the step."""

from collections.abc import Iterator

import numpy as np
from scipy.spatial.transform import Rotation

from touchstone.adapters.conformance import scenes
from touchstone.adapters.conformance.bench import Bench
from touchstone.scenarios.scenario import UNMOVED, Scenario

EQUAL = 1e-6
"""Relative error of a fact [1]: single precision."""


def manifest(bench: Bench) -> Iterator[str]:
    """The manifest states what the scene asks for, as read back from the engine."""
    asked = (scenes.sliding_balls(), scenes.meeting_balls(), scenes.offset_box())
    yield from bench.each(asked, lambda scenario: _facts(bench, scenario))


def _facts(bench: Bench, scenario: Scenario) -> Iterator[str]:
    stated = bench.manifest(scenario)
    if stated.dt and abs(stated.dt / bench.dt - 1) > EQUAL:
        yield f"the manifest states a step of {stated.dt:.6g} s, asked {bench.dt:.6g} s"
    if stated.profile != bench.settings.profile:
        yield f"the manifest states the profile {stated.profile!r}, asked {bench.settings.profile!r}"
    for body in scenario.bodies:
        if body.kind in UNMOVED:
            continue
        found = stated.bodies.get(body.name)
        if found is None:
            yield f"the manifest has no body {body.name!r}"
            continue
        if abs(found.mass - body.mass) > EQUAL * body.mass:
            yield f"mass of {body.name!r} is {found.mass:.6g} kg, asked {body.mass:.6g}"
        if np.abs(np.subtract(found.center_of_mass, body.center_of_mass)).max() > EQUAL:
            yield f"mass centre of {body.name!r} is {found.center_of_mass} m, asked {body.center_of_mass}"
        yield from _inertia(scenario, body.name, np.array(found.inertia))
    asked = {
        _names(scenario.bodies[a].name, scenario.bodies[b].name): scenario.pair_coefficients(a, b)
        for a, b in scenario.touching_pairs()
    }
    found_pairs = {_names(pair.body_a, pair.body_b): pair for pair in stated.pairs}
    for names, (e, mu) in asked.items():
        pair = found_pairs.get(names)
        if pair is None:
            yield f"the manifest has no pair {'-'.join(names)}"
        elif max(abs(pair.restitution - mu), abs(pair.friction - e)) < EQUAL < abs(e - mu):
            yield f"restitution and friction of {'-'.join(names)} are exchanged"
        else:
            if abs(pair.restitution - e) > EQUAL:
                yield f"restitution of {'-'.join(names)} is {pair.restitution:.6g}, asked {e:.6g}"
            if abs(pair.friction - mu) > EQUAL:
                yield f"friction of {'-'.join(names)} is {pair.friction:.6g}, asked {mu:.6g}"


def _names(one: str, two: str) -> tuple[str, str]:
    return (one, two) if one < two else (two, one)


def _inertia(scenario: Scenario, name: str, found: np.ndarray) -> Iterator[str]:
    body = next(one for one in scenario.bodies if one.name == name)
    asked, center = np.array(body.inertia), np.array(body.center_of_mass)
    scale = np.abs(asked).max()
    if np.shape(found) != (3, 3):
        yield f"inertia of {name!r} has the shape {np.shape(found)}, expected (3, 3)"
        return
    if np.abs(found - asked).max() <= EQUAL * scale:
        return
    turn = Rotation.from_quat(np.array(body.orientation), scalar_first=True).as_matrix()
    shifted = asked + body.mass * ((center @ center) * np.eye(3) - np.outer(center, center))
    if np.abs(found - shifted).max() <= EQUAL * scale:
        yield f"inertia of {name!r} is taken about its origin; the contract wants it about the mass centre"
    elif np.abs(found - turn @ asked @ turn.T).max() <= EQUAL * scale:
        yield f"inertia of {name!r} is along the world's axes; the contract wants the body's"
    else:
        yield f"inertia of {name!r} is {found.diagonal().tolist()} kg m^2, asked {asked.diagonal().tolist()}"
