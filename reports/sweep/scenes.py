"""Sources of the scenes of cells: functions of a name and a seed."""

from __future__ import annotations

from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.scenario import Scenario
from touchstone.scenarios.transforms import perturbed

PERTURBATION = 1e-6
"""Displacement of `perturbed_scene` [m]: what single precision and solvers' tolerances leave open."""


def from_catalogue(name: str, seed: int) -> Scenario:
    """The scene of the catalogue; it has no seed."""
    return catalogue()[name]


def perturbed_scene(name: str, seed: int) -> Scenario:
    """The scene of the catalogue with each simulated body, or each tracker if it has none, moved by
    PERTURBATION in a random direction of the seed."""
    return perturbed(catalogue()[name], PERTURBATION, seed)
