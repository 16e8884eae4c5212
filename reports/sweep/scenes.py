"""Sources of the scenes of cells: functions of a name and a seed."""

from __future__ import annotations

from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.files.named import scenes_named
from touchstone.scenarios.scenario import Scenario
from touchstone.scenarios.transforms import perturbed

PERTURBATION = 1e-6
"""Displacement of `perturbed_scene` [m]: what single precision and solvers' tolerances leave open."""
FILE, PERTURBED_FILE = (
    f"touchstone.reports.sweep.scenes:{name}" for name in ("named_scene", "perturbed_named")
)
"""Sources whose scenes may be files."""


def from_catalogue(name: str, seed: int) -> Scenario:
    """The scene of the catalogue; it has no seed."""
    return catalogue()[name]


def perturbed_scene(name: str, seed: int) -> Scenario:
    """The scene of the catalogue with each simulated body, or each tracker if it has none, moved by
    PERTURBATION in a random direction of the seed."""
    return perturbed(catalogue()[name], PERTURBATION, seed)


def named_scene(name: str, seed: int) -> Scenario:
    """The only scene of a file, which may name files outside its folder: whoever asks has checked it."""
    (found,) = scenes_named([name], allow_paths=True)
    return found


def perturbed_named(name: str, seed: int) -> Scenario:
    """The scene of `named_scene`, moved as by `perturbed_scene`."""
    return perturbed(named_scene(name, seed), PERTURBATION, seed)
