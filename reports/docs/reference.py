"""Pages of the documentation: commands, scenes, metrics, settings and engines; measurements; stills.

A page per engine of all its settings: values, their source, the lines to paste, who reviewed them, what each
does to kinds of scenes, and the best for each tolerance.

Lines are what the adapter sets in the scene SCENE with the setting, without what it sets without it.
"""

from __future__ import annotations

import csv
import importlib
import re
import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from io import StringIO
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from PIL import Image

from touchstone.adapters.conformance.abilities import ABILITIES
from touchstone.adapters.contract import Settings
from touchstone.adapters.engines.entry import DEFAULT, Entry
from touchstone.adapters.engines.mujoco.still import View, still
from touchstone.adapters.knobs import SettingError, split
from touchstone.adapters.recorder import record
from touchstone.adapters.registry import (
    DEFAULT_ENGINES,
    ENGINES,
    OPTIONAL_ENGINES,
    entry_of_ours,
    installed,
    load,
    registered,
    settings_of,
)
from touchstone.adapters.scripts.process import settings_lines
from touchstone.reports.changes import table_of
from touchstone.reports.docs.listing import metric_rows, profile_rows, scenario_rows, setting_rows
from touchstone.reports.results import write_beside
from touchstone.reports.runner.request import step_text
from touchstone.reports.runner.tasks import own_profile
from touchstone.reports.studies.knobs import KEPT, Errors, best_of, effects_of, errors_by_label
from touchstone.reports.studies.knobs import SCENES as KINDS
from touchstone.reports.studies.tuning import values_of
from touchstone.reports.verdict.failings import causes, known
from touchstone.reports.views.render import FittingConsole, Part, print_parts
from touchstone.scenarios.catalogue import catalogue, tagged
from touchstone.scenarios.files.safe_paths import fault_line, json_of
from touchstone.scenarios.scenario import Scenario

BETTER = "`lower`: nearer to 0 is better; a signed metric is an error, whose truth is 0."
NOTICE = "<!-- written by `touchstone docs`; do not edit -->"


def table_text(rows: Sequence[Mapping[str, object]], code: Sequence[str] = ()) -> str:
    """A table in Markdown; columns `code` are set as code."""
    heads = list(rows[0])
    lines = ["| " + " | ".join(heads) + " |", "|" + " --- |" * len(heads)]
    for row in rows:
        cells = [f"{row[head]}".replace("|", "\\|") for head in heads]
        cells = [f"`{cell}`" if head in code and cell else cell for head, cell in zip(heads, cells)]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def commands_page(command: Any) -> str:
    """Every command with its arguments and options, from the program's Typer `command`."""
    from typer import Context
    from typer.cli import get_docs_for_click

    context = Context(command, info_name="touchstone", **command.context_settings)
    text = get_docs_for_click(obj=command, ctx=context, name="touchstone", title="Commands")
    return f"{NOTICE}\n\n{text.rstrip()}\n"


def list_pages(pictures: Mapping[str, str]) -> dict[str, str]:
    """Pages of the lists, by file name; `pictures` gives the still of a scene, relative to its page."""
    return {
        "scenes.md": _scenes(pictures),
        "metrics.md": _page("Metrics", BETTER, table_text(metric_rows(), code=("metric",))),
        "profiles.md": _page("Profiles and steps", table_text(profile_rows(), code=("profile",))),
        "settings.md": _page("Settings of the reference", table_text(setting_rows(), ("setting", "values"))),
    }


def _page(title: str, *parts: str) -> str:
    return "\n\n".join([NOTICE, f"# {title}", *parts]) + "\n"


def _scenes(pictures: Mapping[str, str]) -> str:
    rows = {str(row["scenario"]): row for row in scenario_rows()}
    parts = []
    for name, picture in pictures.items():
        parts += [f"## {name}", f"![{name}]({picture})", f"{rows[name]['summary']}."]
    return _page(
        "Scenes",
        "Stills show what the reference plays (`balanced`), drawn from its recording by MuJoCo's renderer.",
        *parts,
        "## All scenes",
        table_text(list(rows.values()), code=("scenario",)),
    )


SCENE = "slip"
"""Scene whose lines are shown: balls on a table, with friction."""
SOURCES = Path(__file__).with_name("settings.csv")
"""Per setting its name in the manual, and who reviewed it."""
EFFECTS = "knobs.csv"
"""What settings do, as `touchstone study knobs` measured it; beside the pages."""
MANUALS = {
    "mujoco": "https://mujoco.readthedocs.io/en/stable/XMLreference.html#{}",
    "bullet": "https://github.com/bulletphysics/bullet3/blob/master/docs/pybullet_quickstartguide.pdf",
    "dart": "https://github.com/dartsim/dart/tree/main/dart",
    "drake": "https://drake.mit.edu/pydrake/{}.html",
}
"""Where an engine documents its settings; braces take the name of one."""
SHOWN = 80


def settings_pages(folder: Path) -> dict[str, str]:
    """Pages by file name, of the engines that are installed and say their settings in their own API, with
    what `EFFECTS` in the folder of these pages holds."""
    path = folder / EFFECTS
    measured = pd.read_csv(path) if path.is_file() else pd.DataFrame(columns=list(KEPT))
    return {
        f"{name}.md": _settings_page(registered(name), errors_by_label(measured, name))
        for name in MANUALS
        if installed(name)
    }


def _settings_page(engine: str, errors: Errors) -> str:
    table, entry = settings_of(engine), ENGINES[engine]
    pasted, rows = _pasted(engine), []
    with open(SOURCES, newline="", encoding="utf-8") as file:
        sources = {(row["engine"], row["setting"]): row for row in csv.DictReader(file)}
    shown = {profile: table.column(profile) for profile in ("default", "recommended")}
    for name, setting in table.items():
        about = sources.get((engine, name), {})
        text, lines = pasted.get(name, ("", []))
        source = about.get("source", "")
        rows.append(
            {
                "setting": f"`{name}`",
                "values": f"`{setting.valid}`",
                **{p: f"`{setting.profiles[k]}`".replace("``", "by scene or step") for p, k in shown.items()},
                "meaning": setting.summary,
                "source": source and f"[{source}]({MANUALS[engine].format(source)})",
                "to paste": f"{text}: " * bool(lines) + "<br>".join(f"`{line}`" for line in lines),
                "reviewed by": " ".join(about.get(key, "") for key in ("by", "date", "link")).strip(),
            }
        )
    steps = ", ".join(f"`{profile}` {1 / dt:.0f} Hz" for profile, dt in entry.profiles.items())
    return _page(
        f"Settings of {engine}",
        f"`touchstone run --set {engine}.KEY=VALUE` plays them. Native steps of the profiles: {steps}. Lines "
        f"to paste are what the adapter sets in the scene `{SCENE}` for the value before them; `touchstone "
        f"reproduce` writes them too, and `touchstone tune SCENE --engine {engine} --position 1mm` searches "
        "values. A settings file of yours is played by [touchstone challenge](../challenge.md).",
        "A source, or a review, is a line in `reports/docs/settings.csv`, by a pull request of whoever knows "
        "the engine.",
        table_text(rows),
        *(_effect_parts(engine, errors) if errors else ()),
    )


def _effect_parts(engine: str, errors: Errors) -> Iterator[str]:
    """What each setting does to each kind of scene, and the best for each tolerance."""
    scenes = ", ".join(f"{kind} `{scene}`" for scene, kind in KINDS.items())
    first = own_profile(engine)
    yield "## What each setting does"
    yield (
        f"Errors over those of `{first}`, where they are a quarter apart, with one setting changed alone: "
        f"{scenes}. `fails`: the run does not end, or an expected event does not happen. Measured by "
        f"`touchstone study knobs --engine {engine}`, errors as in [work_precision](../work_precision.md)."
    )
    effects = {f"`{text}`": said for text, said in effects_of(errors).items()}
    yield table_text([{"setting": text, **said} for text, said in effects.items() if any(said.values())])
    idle = [text for text, said in effects.items() if not any(said.values())]
    yield f"Without effect in these scenes: {', '.join(idle) or 'none'}."
    yield "## The best for each tolerance"
    yield "The cheapest of these and of the profiles with positions within a tolerance; times of one play."
    yield table_text(
        [
            {
                "scene": kind,
                "tolerance": f"{1e3 * tolerance:g} mm",
                "setting": f"`{label}`" if label else "none",
                "error": f"{1e3 * error:.2g} mm" if label else "",
                "frame": f"{1e6 * time:.3g} us" if label else "",
            }
            for kind, tolerance, label, error, time in best_of(errors)
        ]
    )


def _pasted(engine: str) -> dict[str, tuple[str, list[str]]]:
    """Setting -> one of its values, and the lines that set it."""
    scenario, entry = catalogue()[SCENE], ENGINES[engine]
    asked = list(_changes(engine))
    plain = {name: Settings(name, dt) for name, dt in entry.profiles.items()}
    changed = [Settings(profile, entry.profiles[profile], (text,)) for profile, text in asked]
    lines = settings_lines(scenario, engine, [*plain.values(), *changed])
    base = dict(zip(plain, lines))
    found: dict[str, tuple[str, list[str]]] = {}
    for (profile, text), mine in zip(asked, lines[len(plain) :]):
        name, value = split(text)
        new = difference(base[profile], mine) if mine else []
        if new and name not in found:
            shown = [line if len(line) <= SHOWN else f"{line[:SHOWN]}..." for line in new]
            found[name] = f"`{value}`", shown
    return found


def _changes(engine: str) -> Iterator[tuple[str, str]]:
    """Profiles and changes that may show what a setting does, the first profile first."""
    table = settings_of(engine)
    for profile in ENGINES[engine].profiles:
        for setting in table.values():
            for text in values_of(setting):
                try:
                    if table.changes(profile, (text,)):
                        yield profile, text
                        break
                except SettingError:
                    break


def difference(before: list[str], after: list[str]) -> list[str]:
    """Lines of `after` that are not in `before`, with the attributes and arguments that differ."""
    if any(line.startswith("<") for line in after):
        return _elements(before, after)
    old, new = (re.sub(r"\n +", " ", "\n".join(lines)).splitlines() for lines in (before, after))
    known = {item for line in old for item in _arguments(line)}
    found = []
    for line in new:
        if line not in old:
            head = line.partition("(")[0]
            items = [item for item in _arguments(line) if item not in known]
            found.append(f"{head}({', '.join(items)})" if "=" in line[len(head) :] and items else line)
    return found


def _arguments(line: str) -> list[str]:
    return re.findall(r"\w+=[^,()]+(?=[,)])", line)


def _elements(before: list[str], after: list[str]) -> list[str]:
    old, new = (ET.fromstring(f"<all>{''.join(lines)}</all>") for lines in (before, after))
    known = {(one.tag, key, value) for one in old.iter() for key, value in one.attrib.items()}
    found = []
    for one in new.iter():
        own = [f'{key}="{value}"' for key, value in one.attrib.items() if (one.tag, key, value) not in known]
        if own:
            found.append(f"<{one.tag} {' '.join(own)}/>")
    return found


MOST, FEWEST = 3, 3
"""Number of causes of failings that are shown, and of probes of a tag that is."""
DAY = "2026-11-28"
"""Day of the versions, and of the known failings of engines in environments of their own."""
PROBED = (*DEFAULT_ENGINES, "drake", "newton", "physx", "rapier")
"""Engines whose known failings are those of all probes."""
CONSTRAINTS = Path("constraints.txt")
"""Versions that `make` installs, in a checkout."""


def engines_page(checkout: Path) -> str:
    """The page, from the entries of the engines and the known failings."""
    entries = {name: entry_of_ours(name) for name in (*DEFAULT_ENGINES, *OPTIONAL_ENGINES)}
    lines = (checkout / CONSTRAINTS).read_text("utf-8").splitlines()
    pinned = dict(line.split("==")[:2] for line in lines if "==" in line and not line.startswith("#"))
    abilities = [
        {"ability": ability} | {name: "-" if ability in one.lacks else "yes" for name, one in entries.items()}
        for ability in ABILITIES
    ]
    profiles = [
        {
            "engine": name,
            "version": _version(name, one, pinned),
            "profiles and steps [s]": ", ".join(f"`{p}` {step_text(dt)}" for p, dt in one.profiles.items()),
            "the first differs from `default` in": ", ".join(_changed(name, one)) or "-",
            "rounding": one.rounding or "-",
        }
        for name, one in entries.items()
    ]
    return _page(
        "Engines",
        "All have spheres, boxes and Coulomb's law of friction. What an engine lacks is refused with "
        "the reason; a test builds a scene for each ability. An optional engine with an environment of its "
        "own is added by `touchstone env add` ([environments.md](environments.md)).",
        "## What each can represent",
        table_text(abilities),
        "## Profiles",
        f"Versions are those that `make` installs, or that an engine's own environment pins, on {DAY}.",
        table_text(profiles),
        "Newton's Featherstone and semi-implicit solvers have no profile: neither has the observable "
        "`CONTACT_F`, the force of each contact, and the kernel that evaluates it adds up forces per body.",
        "## Where each fails",
        "Known failings of the first profile in the probes, the tags of scenes (CONTRIBUTING.md) in which it "
        f"does best and worst, and the {MOST} causes that show in the most probes; "
        "`reports/verdict/causes.toml` has each with its mechanism. Where none is known, a probe meets all "
        "its limits, or is refused. Only these engines have been judged on all probes.",
        table_text([_failing_row(name, entries[name]) for name in PROBED]),
    )


def _version(name: str, entry: Entry, pinned: dict[str, str]) -> str:
    wanted = entry.distribution or entry.package
    own = dict(pin.split("==") for pin in entry.pins)
    return own.get(wanted) or pinned.get(wanted) or ("of this program" if name == DEFAULT_ENGINES[0] else "-")


def _changed(name: str, entry: Entry) -> Iterator[str]:
    """Settings of the first profile that differ from those of `default`."""
    if DEFAULT not in entry.profiles or not entry.settings:
        return
    table = settings_of(name)
    first, plain = table.column(next(iter(entry.profiles))), table.column(DEFAULT)
    for key, setting in table.items():
        values = setting.profiles[first], setting.profiles[plain]
        if values[0] != values[1]:
            yield f"`{key}` {values[0] or 'by scene'} for {values[1] or 'by scene'}"


def _failing_row(name: str, entry: Entry) -> dict[str, object]:
    probes = {scene.name: set(scene.tags) for scene in tagged("probe")}
    first = next(iter(entry.profiles))
    found: dict[str, set[str]] = {}
    for one in known().values():
        if one.engine == name and one.profile == first and one.scenario in probes:
            found.setdefault(one.cause, set()).add(one.scenario)
    failing = set().union(*found.values()) if found else set()
    counts = Counter(tag for tags in probes.values() for tag in tags - {"probe"})
    shares = {tag: sum(tag in probes[one] for one in failing) / n for tag, n in counts.items() if n >= FEWEST}
    best = min(shares, key=lambda tag: (shares[tag], -counts[tag], tag))
    worst = max(shares, key=lambda tag: (shares[tag], counts[tag], tag))
    ranked = sorted(found, key=lambda cause: (-len(found[cause]), cause))[:MOST]
    return {
        "engine": name,
        "probes with a known failing": f"{len(failing)} of {len(probes)}",
        "least of a tag": f"`{best}`: {round(shares[best] * counts[best])} of {counts[best]}",
        "most of a tag": f"`{worst}`: {round(shares[worst] * counts[worst])} of {counts[worst]}",
        "causes in the most scenes": "<br>".join(
            f"{len(found[cause])}: {' '.join(causes()[cause].split()).partition(':')[0]}" for cause in ranked
        ),
    }


WIDTH = 120
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
    shown = [f"![{picture.rpartition('.')[0]}](pictures/{picture})" for picture in pictures]
    whole = study in ("run", "import") or study.startswith(("bench ", "reality "))
    title = f"`touchstone {study if whole else f'study {study}'}`"
    return f"{name}.md", _page(title, origin, f"```text\n{text}\n\n```", *shown), pictures


def _origin(facts: dict) -> str:
    # without the path of that machine
    command = re.sub(r" --out(=| )('[^']*'|\S+)", "", facts.get("command") or "")
    known = {"Command": command, "commit": facts.get("commit"), "day": facts.get("day")}
    known |= {name: facts.get("machine", {}).get(name) for name in ("processor", "cores")}
    return ", ".join(f"{name} `{value}`" for name, value in known.items() if value) + "."


def _text(study: str, frame: pd.DataFrame) -> str:
    out = StringIO()
    console = FittingConsole(file=out, width=WIDTH, no_color=True, force_terminal=False)
    print_parts([replace(part, wrap=True) for part in _report_of(study)(frame)], console)
    return "\n".join(line.rstrip() for line in out.getvalue().strip("\n").splitlines())


def _report_of(study: str) -> Callable[[pd.DataFrame], list[Part]]:
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
    "ball_snip": Shot(0.40, azimuth=120.0, elevation=-25.0, distance=0.4, at="ball"),
    "corner_slide": Shot(2.6),
    "push_box": Shot(1.9, distance=3.2),
    "table_slide": Shot(5.7, elevation=-25.0, distance=0.75, at="palm"),
    "two_arms": Shot(3.25),
    "volley": Shot(0.43, azimuth=100.0, elevation=-15.0),
    "wall_push": Shot(3.0),
}


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
