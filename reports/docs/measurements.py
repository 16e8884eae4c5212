"""Pages of measurements: the tables and pictures of a results folder, with the command that measured them."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import partial
from io import StringIO
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from PIL import Image

from touchstone.adapters.contract import Settings
from touchstone.adapters.engines.mujoco.still import View, still
from touchstone.adapters.recorder import record
from touchstone.adapters.registry import ENGINES, load
from touchstone.reports.changes import table_of
from touchstone.reports.docs.reference import NOTICE
from touchstone.reports.results import write_beside
from touchstone.reports.views.render import FittingConsole, Part, print_parts
from touchstone.scenarios.files.safe_paths import fault_line, json_of
from touchstone.scenarios.scenario import Scenario

WIDTH = 120
"""Width of tables in characters."""
SHOWN_BY = {
    "run": "touchstone.reports.views.terminal",
    "import": "touchstone.reports.studies.robots",
    "ik": "touchstone.reports.studies.inverse_kinematics",
    "reality tosses": "touchstone.reports.studies.tosses",
}
"""Modules whose `report` has a study's table, where they are not `reports/studies/NAME`."""


class NoResults(Exception):
    """A folder holds no results; the message says what is missing."""


def page_of(folder: Path) -> tuple[str, str, dict[str, Path]]:
    """Name and text of the page of a results folder, and the pictures that it shows by their new names.

    Raises:
        NoResults: the folder has no table with rows, no manifest, or a table of another study.
    """
    try:
        frame = table_of(folder)
        facts = json_of(folder / "manifest.json")
        study, origin = str(frame.study.iloc[0]), _origin(facts)
    except (OSError, ValueError, IndexError, AttributeError) as error:
        raise NoResults(f"{folder}: no results of a run, study or bench ({fault_line(error)})") from error
    try:
        text = _text(study, frame)
    except NoResults:
        raise
    except Exception as error:
        reason = f"{type(error).__name__}: {fault_line(error)}"
        raise NoResults(f"{folder}: cannot be shown as a table of {study!r} ({reason})") from error
    name = study.replace(" ", "-")
    pictures = {f"{name}-{path.name}": path for path in sorted(folder.glob("*.png"))}
    parts = [NOTICE, f"# `touchstone {_command(study)}`", origin]
    parts += ["```text", text, "```"]
    parts += [f"![{picture.rpartition('.')[0]}](pictures/{picture})" for picture in pictures]
    return f"{name}.md", "\n\n".join(parts).replace("```text\n\n", "```text\n") + "\n", pictures


def _command(study: str) -> str:
    whole = study in ("run", "import") or study.startswith(("bench ", "reality "))
    return study if whole else f"study {study}"


def _origin(facts: dict) -> str:
    """What measured the table: command, commit, day, and machine."""
    machine = facts.get("machine", {})
    known = (
        ("Command", facts.get("command")),
        ("commit", facts.get("commit")),
        ("day", facts.get("day")),
        ("processor", machine.get("processor")),
        ("cores", machine.get("cores")),
    )
    return ", ".join(f"{name} `{value}`" for name, value in known if value) + "."


def _text(study: str, frame: pd.DataFrame) -> str:
    """The table as the command prints it."""
    out = StringIO()
    console = FittingConsole(file=out, width=WIDTH, no_color=True, force_terminal=False)
    print_parts([replace(part, wrap=True) for part in _report_of(study)(frame)], console)
    return "\n".join(line.rstrip() for line in out.getvalue().strip("\n").splitlines())


def _report_of(study: str) -> Callable[[pd.DataFrame], list[Part]]:
    """The function of a study's report."""
    bench = study.partition("bench ")[2]
    home = f"bench.{bench}" if bench else f"studies.{study.replace('-', '_')}"
    try:
        module = importlib.import_module(SHOWN_BY.get(study, f"touchstone.reports.{home}"))
        if not hasattr(module, "report"):
            module = importlib.import_module(f"{module.__name__}.study")
        report: Callable[[pd.DataFrame], list[Part]] = module.report
    except (ModuleNotFoundError, AttributeError) as error:
        raise NoResults(f"no module shows the study {study!r}") from error
    return report


class Shot(NamedTuple):
    """Moment [s] and camera of a still: angles [degrees], and distance [m] from the body `at`, or from the
    middle of all that moves."""

    time: float
    azimuth: float = 60.0
    elevation: float = -18.0
    distance: float = 3.0
    at: str = ""


SHOTS = {
    "arms_cross": Shot(2.4, azimuth=150.0),
    "ball_snip": Shot(0.40, azimuth=120.0, elevation=-25.0, distance=0.5, at="palm"),
    "corner_slide": Shot(2.6),
    "push_box": Shot(1.9, distance=3.2),
    "table_slide": Shot(5.7, elevation=-25.0, distance=0.9, at="palm"),
    "two_arms": Shot(3.25),
    "volley": Shot(0.43, azimuth=100.0, elevation=-15.0),
    "wall_push": Shot(3.0),
}
"""Stills of the gallery."""


def draw(scenarios: Iterable[Scenario], folder: Path) -> Iterator[str]:
    """Play each scene up to its shot and draw it into `folder`; yields the names of the scenes."""
    for scenario in scenarios:
        shot = SHOTS.get(scenario.name, Shot(scenario.duration / 2))
        picture = Image.fromarray(_picture(scenario, shot))
        save = partial(picture.save, format="png", optimize=True)
        write_beside(folder / f"{scenario.name}.png", save)
        yield scenario.name


def _picture(scenario: Scenario, shot: Shot) -> np.ndarray:
    profile, dt = next(iter(ENGINES["reference"].profiles.items()))
    recording = record(load("reference"), scenario, Settings(profile, dt))
    frame = round(shot.time * scenario.frame_rate)
    position, orientation = recording.position[frame], recording.orientation[frame]
    moving = [k for k, body in enumerate(scenario.bodies) if body.kind != "fixed" and body.pieces]
    seen = position[[scenario.body_index(shot.at)] if shot.at else moving]
    x, y, z = ((seen.min(axis=0) + seen.max(axis=0)) / 2).tolist()
    view = View((x, y, z), shot.distance, shot.azimuth, shot.elevation)
    return still(scenario, position, orientation, view)
