"""What entries say that engines lack: they refuse it, and build a scene of every other ability."""

import re
from dataclasses import replace
from types import SimpleNamespace

import pytest
from refusals import refused, undriven

from touchstone.adapters.conformance.abilities import ABILITIES
from touchstone.adapters.contract import Unsupported
from touchstone.adapters.recorder import build
from touchstone.adapters.registry import (
    OURS,
    entry_of_ours,
    installed,
    load,
    missing_reason,
    registered,
)
from touchstone.adapters.workers.children import Children, Job
from touchstone.adapters.workers.pool import EngineProcess
from touchstone.scenarios.catalogue import catalogue

SHORT = 1 / 30
"""Duration of scenes in children [s]."""
UNTIMED = {"truths": (), "forces": (), "published": (), "expectations": ()}
LEFT_OUT = 0.1
"""Largest share of the probes without driven bodies that a column refuses [1]; bullet, mujoco, mujoco_warp
and physx refuse 2 of 52, with cones."""
SLOW = ("newton", "mujoco_warp")
"""Engines that compile their kernels."""


def each() -> list:
    """Engines of ours; skipped where they are not installed."""
    return [
        pytest.param(
            name,
            marks=[
                pytest.mark.engines,
                pytest.mark.skipif(not installed(name), reason=f"{name}: {missing_reason(name)}"),
                *([pytest.mark.slow] if name in SLOW else []),
            ],
        )
        for name in OURS
    ]


@pytest.mark.parametrize("name", OURS)
def test_entries_name_abilities(name):
    """What an entry lacks is an ability, and each ability has a scene."""
    assert set(entry_of_ours(name).lacks) <= set(ABILITIES)
    assert len(set(entry_of_ours(name).lacks)) == len(entry_of_ours(name).lacks)
    assert {asked.scene for asked in ABILITIES.values()} <= set(catalogue())


@pytest.mark.parametrize("name", each())
def test_an_engine_refuses_what_it_lacks(name, tmp_path):
    """It refuses the scenes of these abilities alone."""
    entry = entry_of_ours(registered(name))
    refused = refused_in_child(name, tmp_path) if entry.pins else refused_here(name)
    assert refused == set(entry.lacks)


@pytest.mark.engines
@pytest.mark.parametrize(
    ("name", "profiles"),
    [
        *(
            (name, ("recommended",))
            for name in ("dart", "bullet", "mujoco", "mujoco_warp", "physx", "rapier")
        ),
        # half a minute
        pytest.param("newton", ("xpbd", "steel"), marks=pytest.mark.slow),
        ("reference", ("balanced",)),
    ],
)
def test_columns_play_nine_tenths_of_the_undriven_probes(name, profiles, tmp_path):
    """Nine columns refuse at most a tenth, each scene with a reason that names the engine."""
    registered(name)
    if not installed(name):
        pytest.skip(f"{name}: {missing_reason(name)}")
    child = EngineProcess(refused, tmp_path / "output.txt") if entry_of_ours(name).pins else None
    for profile in profiles:
        task = SimpleNamespace(engine=name, profile=profile)
        found = child.ask("play", task) if child else refused(load(name), task)
        assert child is None or child.failure is None
        assert len(found) <= LEFT_OUT * len(undriven())
        assert all(re.match(r"\w+: \w+", reason) for reason in found.values())
    if child:
        child.stop()


def refused_here(name):
    """Abilities that an engine of this process refuses."""
    found, engine = set(), load(name)
    for ability, asked in ABILITIES.items():
        try:
            build(engine, catalogue()[asked.scene], asked.settings(name))[0].close()
        except Unsupported:
            found.add(ability)
    return found


def refused_in_child(name, folder):
    """Abilities that an engine in an environment of its own refuses."""
    found = set()
    with Children() as children:
        for k, (ability, asked) in enumerate(ABILITIES.items()):
            scenario = replace(catalogue()[asked.scene], duration=SHORT, **UNTIMED)
            files = folder / f"{k}.npz", folder / f"{k}.txt"
            job = Job(name, scenario, asked.settings(name), *files)
            (outcome,) = children.play([job], lambda label, frames: None)
            assert outcome.status in ("done", "skipped"), (ability, outcome.reason)
            if outcome.status == "skipped":
                found.add(ability)
    return found
