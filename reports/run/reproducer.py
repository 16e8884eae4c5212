"""A script in an engine's own API that shows what a column does in a scene, checked against its recording."""

from __future__ import annotations

import textwrap
from dataclasses import dataclass
from math import isfinite, nan
from pathlib import Path

from touchstone.adapters.contract import AdapterError, Settings, Unsupported
from touchstone.adapters.engines.entry import ENGINES
from touchstone.adapters.scripts.process import Script, distance, run, written
from touchstone.adapters.scripts.script import WIDTH
from touchstone.adapters.workers.scratch import scratch_folder
from touchstone.reports.progress import Progress
from touchstone.reports.results import Row, rows_of
from touchstone.reports.run.study import run as play
from touchstone.reports.runner.request import Request, script_command, step_text
from touchstone.scenarios.scenario import Scenario

MISSED = ("fail", "known", "error")
SHOWN = 4


@dataclass(frozen=True, slots=True)
class Reproduced:
    """A script and how it compares with the recording.

    Attributes:
        script: the script.
        missed: lines of the limits that the column misses.
        apart: largest difference of a coordinate from the recording [m]; 0: equal to the bit.
    """

    script: Script
    missed: tuple[str, ...]
    apart: float


def reproduced(scenario: Scenario, engine: str, settings: Settings, progress: Progress) -> Reproduced:
    """Play and judge a scene, write its script, run it, and compare what it prints with the recording.

    Raises:
        AdapterError: the engine cannot represent the scene, has no scripts, or the script fails.
    """
    if not ENGINES[engine].script:
        written(scenario, engine, settings)  # says which engines have scripts
    changes = tuple(f"{engine}.{change}" for change in settings.changes)
    with scratch_folder() as folder:
        columns = ((engine, settings.profile),)
        request = Request((scenario,), columns, folder / "run", settings.dt, changes=changes)
        results = play(request, progress)
        rows = rows_of(results.frame)
        for row in rows:
            if row.metric == "run" and row.verdict == Unsupported.status:
                raise Unsupported(row.reason)
        key = (scenario.name, engine, settings.label)
        recording = results.recordings.get(key) or results.ended.get(key)
        missed = tuple(_line(row) for row in rows if row.verdict in MISSED)
        script = written(scenario, engine, settings, head(scenario, engine, settings, missed))
        if recording is None:
            raise AdapterError(f"{engine}: {rows[0].reason if rows else 'nothing was recorded'}")
        path = Path(folder, "script.py")
        path.write_text(script.text, "utf-8")
        return Reproduced(script, missed, distance(run(path), recording, scenario, script.of_mass))


def head(scenario: Scenario, engine: str, settings: Settings, missed: tuple[str, ...]) -> list[str]:
    """Lines of the docstring of a script."""
    asked = Row("run", scenario.name, engine, settings.label, settings.dt or nan, "run")
    how = f"Profile {settings.label}, {step_text(settings.dt)} s."
    lines = [f"{scenario.name} in {engine}: {scenario.summary}. {how}"]
    lines += [f"Misses {line}" for line in missed[:SHOWN]]
    lines += [f"and {len(missed) - SHOWN} more limits"] if len(missed) > SHOWN else []
    lines.append(f"Prints time [s], position [m] and name of bodies. {script_command(asked)}")
    plain = [line.replace("\\", "/").replace('"""', "'''") for line in lines]
    return [textwrap.shorten(line, 3 * WIDTH, placeholder=" ...") for line in plain]


def _line(row: Row) -> str:
    if row.metric == "run":
        return f"the end of the scene: {row.reason}"
    unit = "" if row.unit == "1" else f" {row.unit}"
    limit = f", limit {row.limit:.3g}{unit}" if isfinite(row.limit) else ""
    return f"{row.metric} {row.subject}".strip() + f" {row.value:.4g}{unit}{limit}: {row.reason}"
