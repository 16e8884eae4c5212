"""Cells of a sweep: one scene, engine, profile, step, settings, seed and repeat each, and what to measure."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from typing import Any

from touchstone.adapters.contract import DRIVES, Settings
from touchstone.adapters.registry import ENGINES, changes_of, settings_of
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.effects import PLANNED
from touchstone.scenarios.files.named import scenes_named
from touchstone.scenarios.scenario import Scenario
from touchstone.scenarios.transforms import perturbed

PERTURBATION = 1e-6
"""Displacement of `perturbed_scene` [m]: what single precision and solvers' tolerances leave open."""
FILE, PERTURBED_FILE = (
    f"touchstone.reports.runner.cells:{name}" for name in ("named_scene", "perturbed_named")
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


ACCURACY = "touchstone.reports.runner.measures:accuracy"
TIMING = "touchstone.reports.runner.measures:timing"
CATALOGUE = "touchstone.reports.runner.cells:from_catalogue"
PERTURBED = "touchstone.reports.runner.cells:perturbed_scene"
"""Names of measures and of sources of scenes: "module:function"."""
SCENES_KEPT = 512


@dataclass(frozen=True, slots=True)
class Cell:
    """One independent measurement.

    Attributes:
        scenario: name of the scene.
        dt: native step [s].
        changes: "key=value" that differ from the profile.
        seed: of the scene, where its source draws it.
        effects: all effects instead of those that the scene requires.
        measure: "module:function" called as f(cell, scenario, engine), which returns `results.Row`s or
            `measures.Course`s.
        source: "module:function" called as f(scenario, seed), which returns the scene.
        options: "key=value" for the measure; `drive` is that of the settings.
        repeat: number of the repetition, for measures that are not deterministic.
    """

    scenario: str
    engine: str
    profile: str
    dt: float
    changes: tuple[str, ...] = ()
    seed: int = 0
    effects: bool = False
    measure: str = ACCURACY
    source: str = CATALOGUE
    options: tuple[str, ...] = ()
    repeat: int = 0

    @property
    def settings(self) -> Settings:
        """How to run the engine."""
        effects, drive = PLANNED if self.effects else None, self.option("drive", DRIVES[0])
        return Settings(self.profile, self.dt, self.changes, effects, drive=drive)

    @property
    def label(self) -> str:
        """Text for progress: scene, engine and settings."""
        return f"{self.scenario} {self.engine} {self.settings.label} 1/{1 / self.dt:.6g}"

    def option(self, key: str, default: str = "") -> str:
        """Value of one of `options`."""
        return dict(text.split("=", 1) for text in self.options).get(key, default)


@lru_cache(SCENES_KEPT)
def scene_of(source: str, name: str, seed: int) -> Scenario:
    """The scene of a cell, built once per process."""
    scenario: Scenario = named(source)(name, seed)
    return scenario


def named(path: str) -> Callable[..., Any]:
    """Function for "module:function"."""
    module, _, attribute = path.partition(":")
    found: Callable[..., Any] = getattr(importlib.import_module(module), attribute)
    return found


def combinations(engine: str, profile: str, asked: Iterable[str]) -> list[tuple[str, ...]]:
    """Every combination of "key=value,value" or "engine.key=value,value" that concerns an engine, as changes.

    Settings that other engines have leave this one as it is.

    Raises:
        SettingError: no engine has such a setting, or this one has no such value.
    """
    choices: dict[str, list[str]] = {}
    for text in asked:
        key, _, values = text.partition("=")
        own = [name for name in ENGINES if key.strip().rpartition(".")[2] in settings_of(name)]
        if "." not in key and engine not in own and own:
            continue
        choices.setdefault(key.strip(), []).extend(values.split(","))
    chosen = product(*([f"{key}={value}" for value in values] for key, values in choices.items()))
    return list(dict.fromkeys(changes_of(engine, profile, one) for one in chosen))


def grid(
    scenes: Sequence[str],
    columns: Iterable[tuple[str, str]],
    *,
    steps: Sequence[float] = (),
    changes: Sequence[str] = (),
    seeds: Sequence[int] = (0,),
    repeats: int = 1,
    **fixed: Any,
) -> list[Cell]:
    """All combinations as cells, each once.

    Args:
        columns: (engine, profile).
        steps: native steps [s]; none: that of each profile.
        changes: "key=value,value" texts; each engine plays every combination of those that it has.
        seeds: 0 is the scene as it is; others perturb it (`scenes.perturbed_scene`), without a `source`.
        fixed: further fields that all cells share.
    """
    sources = {seed: {"source": PERTURBED if seed else CATALOGUE} | fixed for seed in seeds}
    cells = [
        Cell(scene, engine, profile, dt, changed, seed, repeat=repeat, **sources[seed])
        for scene, (engine, profile) in product(scenes, columns)
        for dt in (steps or (ENGINES[engine].profiles[profile],))
        for changed in combinations(engine, profile, changes)
        for seed, repeat in product(seeds, range(repeats))
    ]
    return list(dict.fromkeys(cells))
