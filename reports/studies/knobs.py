"""The study `knobs`: what each setting of an engine does to each kind of scene, the best for each tolerance.

An engine's first profile is played with each of its settings changed alone, to its other names or to the ends
of what `touchstone tune` tries, and beside it every other profile. Errors are those of `work-precision`, of
scenes with a closed form. `touchstone docs` keeps them for the pages of settings.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from math import inf, isfinite, nan
from pathlib import Path

import pandas as pd

from touchstone.adapters.contract import Settings
from touchstone.adapters.knobs import Choice, SettingError
from touchstone.adapters.registry import ENGINES, settings_of
from touchstone.reports.output_folder import output_folder
from touchstone.reports.progress import Progress
from touchstone.reports.results import Row
from touchstone.reports.runner.cells import Cell
from touchstone.reports.runner.request import line_of
from touchstone.reports.runner.sweep import sweep
from touchstone.reports.runner.tasks import own_profile, own_step
from touchstone.reports.studies.study import failures, kept
from touchstone.reports.studies.tuning import values_of
from touchstone.reports.studies.work_precision.points import QUANTITIES, SweptRuns, errors_of
from touchstone.reports.views.render import Part
from touchstone.scenarios.catalogue import catalogue

STUDY = "knobs"
SCENES = {"bounce_e05": "impact", "slide": "sliding", "slip": "rolling", "stack": "rest"}
"""Scenes with a closed form, and what happens in them."""
TIME = "time.frame"
KEPT = ("engine", "profile", "scenario", "metric", "value")
"""Columns that the pages of settings need."""
TOLERANCES = (1e-2, 1e-3, 1e-4)
"""Errors of positions for which the cheapest setting is named [m]."""
NOTED = 1.25
"""Ratio of errors, up or down, from which a setting counts as doing something [1]."""


def cells_of(engine: str) -> list[Cell]:
    """The first profile plain, with each setting changed alone, and the other profiles, in every scene."""
    first, table = own_profile(engine), settings_of(engine)
    labels: list[tuple[str, tuple[str, ...]]] = [(profile, ()) for profile in ENGINES[engine].profiles]
    for setting in table.values():
        values = values_of(setting)
        for text in values if isinstance(setting, Choice) else dict.fromkeys((values[0], values[-1])):
            try:
                labels.append((first, table.changes(first, (text,))))
            except SettingError:  # it does nothing in this profile
                continue
    steps = {profile: own_step(engine, profile) for profile, _ in labels}
    return [
        Cell(scene, engine, profile, steps[profile], changes)
        for scene in SCENES
        for profile, changes in dict.fromkeys(labels)
    ]


def run(
    engines: Sequence[str], store: Path, out: Path, progress: Progress, jobs: int | None = None
) -> pd.DataFrame:
    """Play what the store lacks; the folder `out` appears complete or not at all."""
    cells = [cell for engine in engines for cell in cells_of(engine)]
    with output_folder(out) as folder:
        swept = SweptRuns(sweep(cells, store, jobs=jobs, progress=progress, series=True))
        truths = {scene: swept.truth(catalogue()[scene], []) for scene in SCENES}
        rows = [row for cell in cells for row in _rows(cell, swept, truths)]
        return kept(rows, folder, {"study": STUDY, "scenes": SCENES, "store": str(store)})


def _rows(cell: Cell, swept: SweptRuns, truths: Mapping[str, object]) -> Iterator[Row]:
    """Errors and mean frame of a cell; infinite errors if it did not end, no rows if it was refused."""
    if "skipped" in set(swept.rows(cell).outcome):
        return
    label = Settings(cell.profile, cell.dt, cell.changes).label
    key = (STUDY, cell.scenario, cell.engine, label, cell.dt)
    run, again = swept.run(cell), line_of(cell)
    errors = {} if run is None else errors_of(run, truths[cell.scenario])  # type: ignore[arg-type]
    time = nan if run is None else float(run.frames.mean())
    yield Row(*key, TIME, time, "s", reproduce=again)
    for name, value in ({"position": inf} if run is None else errors).items():
        yield Row(*key, f"error.{name}", float(value), QUANTITIES[name].unit, reproduce=again)


Errors = dict[str, dict[tuple[str, str], float]]
"""By profile with its changes: error by scene and quantity, and the mean frame [s] as quantity TIME."""


def errors_by_label(frame: pd.DataFrame, engine: str) -> Errors:
    """What the rows of an engine hold; of their columns those of KEPT are read."""
    found: Errors = {}
    rows = frame.loc[frame.engine == engine, list(KEPT)]
    for _, label, scene, metric, value in rows.itertuples(index=False):
        found.setdefault(label, {})[scene, metric.removeprefix("error.")] = value
    return found


def effects_of(errors: Errors) -> dict[str, dict[str, str]]:
    """By "key=value" of the first profile: kind of scene -> what the change does to its errors, in words."""
    first, plain = next(iter(errors.items()))
    return {
        label.partition(", ")[2]: {kind: _effect(plain, mine, scene) for scene, kind in SCENES.items()}
        for label, mine in errors.items()
        if label.startswith(f"{first}, ")
    }


def _effect(plain: Mapping[tuple[str, str], float], mine: Mapping[tuple[str, str], float], scene: str) -> str:
    """Ratios of the errors that change by NOTED or more; errors below the floor count as the floor."""
    said = []
    for name, quantity in QUANTITIES.items():
        before, after = plain.get((scene, name), nan), mine.get((scene, name), nan)
        if not isfinite(before):
            continue
        ratio = max(after, quantity.floor) / max(before, quantity.floor)
        if ratio == inf:
            said.append(f"{name} fails")
        elif ratio >= NOTED or ratio <= 1 / NOTED:
            said.append(f"{name} x {ratio:.2g}")
    return ", ".join(said)


def best_of(errors: Errors) -> list[tuple[str, float, str, float, float]]:
    """The cheapest setting within each tolerance of positions, by kind of scene: tolerance [m], label, error
    [m], mean frame [s]; the label is empty where none is within."""
    found = []
    for scene, kind in SCENES.items():
        places = [
            (mine.get((scene, TIME), inf), mine.get((scene, "position"), inf), label)
            for label, mine in errors.items()
        ]
        for tolerance in TOLERANCES:
            within = (place for place in places if place[1] <= tolerance)
            time, error, label = min(within, default=(nan, nan, ""))
            found.append((kind, tolerance, label, error, time))
    return found


def _figures(label: str, error: float, time: float) -> tuple[str, str]:
    """An error and the time of a frame in words; empty without a setting."""
    return (f"{1e3 * error:.2g} mm", f"{1e6 * time:.3g}") if label else ("", "")


def report(frame: pd.DataFrame) -> list[Part]:
    """Per engine what settings do, and the best per tolerance."""
    parts = []
    for engine in dict.fromkeys(frame.engine):
        errors = errors_by_label(frame, engine)
        heads = ["setting", *SCENES.values()]
        cells = [[text, *said.values()] for text, said in effects_of(errors).items()]
        parts.append(Part(f"{engine}: errors over those of the first profile", heads, cells, words=5))
        best = [
            [kind, f"{1e3 * tolerance:g} mm", label or "none", *_figures(label, error, time)]
            for kind, tolerance, label, error, time in best_of(errors)
        ]
        heads = ["scene", "tolerance", "setting", "error", "frame [us]"]
        parts.append(Part(f"{engine}: the cheapest of these within a tolerance", heads, best, words=3))
    notes = ("x: error over that of the first profile, if a quarter apart; fails: no end, or no such event",)
    return [*parts, Part(notes=notes), failures(frame)]
