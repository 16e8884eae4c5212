"""The study `calibration`: restitution and friction that engines achieve, compared with the requested values.

Every engine plays the same small scenes under each of its profiles; the estimates use only the bodies'
motion. Adapters never read the results.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from math import isnan, nan
from pathlib import Path
from typing import Any

import altair as alt
import numpy as np
import pandas as pd

from touchstone.adapters.contract import Settings
from touchstone.adapters.registry import ACCURATE, DEFAULT, ENGINES, installed, load
from touchstone.adapters.workers.pool import Loader
from touchstone.reports.output_folder import output_folder
from touchstone.reports.progress import Progress
from touchstone.reports.results import rows_of
from touchstone.reports.runner.request import step_text
from touchstone.reports.runner.tasks import own_step, played
from touchstone.reports.studies.calibration.probes import (
    ALL,
    HEIGHT,
    JUDGED_SPEED,
    SHAPES,
    STUDY,
    G,
    Probe,
    ProbeMotion,
    ProbeTask,
    measure,
    rows_of_engine,
    subject_of,
)
from touchstone.reports.studies.study import Column, failure_lines, failures, kept, missing_rows
from touchstone.reports.verdict.judge import judged
from touchstone.reports.views.pictures import DASHES, DOTS, PALE, axis, by, color_of, grid, rule, save
from touchstone.reports.views.render import Part, markdown

LADDER_PART = 26
"""Bodies of the ladder per scene: more would overflow an engine's log of contacts."""


@dataclass(frozen=True, slots=True)
class Requested:
    """Requested values: restitutions at approach `speeds` [m/s], frictions at `headings` [degrees], a ladder
    of speeds for the lowest one that bounces, slow slides at `slips` [m/s], and e = 1 from a fall under
    several steps [1/s]."""

    pairs: tuple[str, ...] = tuple(SHAPES)
    restitutions: tuple[float, ...] = (0.0, 0.3, 0.5, 0.8, 1.0)
    speeds: tuple[float, ...] = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0)
    phases: tuple[float, ...] = (1 / 6, 1 / 2, 5 / 6)
    frictions: tuple[float, ...] = (0.1, 0.3, 0.5, 1.0)
    headings: tuple[float, ...] = (0.0, 22.5, 45.0)
    slips: tuple[float, ...] = (1e-3, 1e-2, 0.1)
    ladder: tuple[float, ...] = tuple(0.02 * 1.05**k for k in range(71))
    steps: tuple[int, ...] = (60, 240, 1000, 4000)
    drop_phases: tuple[float, ...] = tuple(k / 8 for k in range(8))


def tasks(columns: Sequence[Column], grid: Requested) -> list[ProbeTask]:
    """All probes, engine by engine; steps other than an engine's own only under its first profile."""
    found: list[ProbeTask] = []
    drop = Probe("sphere-box", "drop", 1.0, phases=grid.drop_phases)
    for engine in dict.fromkeys(engine for engine, _ in columns):
        profiles = [profile for name, profile in columns if name == engine]
        for profile in profiles:
            settings = Settings(profile, own_step(engine, profile))
            found += [ProbeTask(engine, settings, probe) for probe in probes_of(grid)]
        found += [ProbeTask(engine, Settings(profiles[0], 1 / rate), drop) for rate in grid.steps]
    return found


def probes_of(grid: Requested) -> list[Probe]:
    """The scenes of one column. Spheres meet the floor at every phase of a step, the others at its middle."""
    probes = []
    for pair in grid.pairs:
        phases = grid.phases if pair == "sphere-box" else (0.5,)
        probes += [Probe(pair, "restitution", e, grid.speeds, phases) for e in grid.restitutions]
        probes += [Probe(pair, "friction", mu, headings=grid.headings) for mu in grid.frictions]
        if pair != "sphere-box":  # a sphere rolls
            probes += [Probe(pair, "slow", mu, (v,)) for mu in grid.frictions for v in grid.slips]
    parts = (grid.ladder[k : k + LADDER_PART] for k in range(0, len(grid.ladder), LADDER_PART))
    return probes + [Probe("sphere-box", "lowest", 1.0, speeds, (0.5,)) for speeds in parts]


def run(
    columns: Sequence[Column],
    out: Path,
    progress: Progress,
    grid: Requested | None = None,
    loader: Loader = load,
) -> pd.DataFrame:
    """Play all columns; store rows, picture, report and manifest. The folder appears complete or not at
    all."""
    grid = grid or Requested()
    with output_folder(out) as folder:
        asked = tasks([column for column in columns if installed(column[0])], grid)
        found = list(zip(asked, played(measure, asked, folder / "output", progress, loader=loader)))
        rows = missing_rows(STUDY, columns)
        engines = {}
        for engine in dict.fromkeys(engine for engine, _ in columns):
            mine = [(task, one) for task, one in found if task.engine == engine]
            rows += rows_of_engine(mine)
            version = next((one.version for _, one in mine if isinstance(one, ProbeMotion)), "")
            profiles = [profile for name, profile in columns if name == engine]
            engines[engine] = {"version": version, "profiles": profiles}
        facts = {"study": STUDY, "grid": asdict(grid), "engines": engines}
        pictures = {"report.md": write_report, "calibration.png": requested_and_achieved}
        return kept([judged(row, ()) for row in rows], folder, facts, pictures)


SHOWN_SPEED = 1.0
"""Approach speed of the restitutions in the table [m/s]."""
NOTES = (
    f"asked: what a sphere at {SHOWN_SPEED:g} m/s returned; bias: largest |achieved - asked| from 1 m/s on",
    "lowest: speed from which on a quarter of e = 1 is returned, or the least one tried",
    "friction: mean over the coefficients asked; bias: the largest of a single one",
    "-: a hop of less than two steps, or a slide that is over within two",
)


class Values:
    """The values of a calibration's rows, by (engine, profile, scenario, metric, subject)."""

    def __init__(self, frame: pd.DataFrame) -> None:
        rows = rows_of(frame[frame.metric != "run"])
        self.steps = {(r.engine, r.profile): r.dt for r in reversed(rows) if r.metric != "restitution.drop"}
        self.columns = [
            key for key in dict.fromkeys((r.engine, r.profile) for r in rows) if key in self.steps
        ]
        self._rows = {(r.engine, r.profile, r.scenario, r.metric, r.subject): r.value for r in rows}
        subjects = [r.subject for r in rows]
        self.restitutions = asked(subjects, "e")
        self.frictions, self.headings = asked(subjects, "mu"), asked(subjects, "heading")
        slow = [r.subject for r in rows if r.metric == "friction.slow"]
        fast = [r.subject for r in rows if r.metric == "restitution.achieved"]
        self.slips, self.speeds = asked(slow, "v"), asked(fast, "v")

    def __call__(self, column: tuple[str, str], pair: str, metric: str, subject: str = "") -> float:
        return self._rows.get((*column, pair, metric, subject), nan)

    def first(self, engine: str) -> str:
        """The engine's default profile, else its first, or ""."""
        own = [profile for name, profile in self.columns if name == engine]
        return DEFAULT if DEFAULT in own else next(iter(own), "")

    def both(self, engine: str) -> tuple[tuple[str, str], tuple[str, str]]:
        """The columns of an engine's default and of its accurate profile."""
        return (engine, self.first(engine)), (engine, ACCURATE)

    def step(self, engine: str) -> float:
        """Native step of an engine in its default profile [s]."""
        return self.steps.get((engine, self.first(engine)), nan)

    def lowest(self, engine: str) -> float:
        """Lowest speed that bounces under an engine's first profile [m/s]."""
        return self((engine, self.first(engine)), "sphere-box", "restitution.lowest", "e=1")

    def share(self, column: tuple[str, str], pair: str, heading: float) -> float:
        """Achieved over requested friction along a heading, mean over the coefficients."""
        found = [
            self(column, pair, "friction.bias", subject_of("friction", mu, heading)) for mu in self.frictions
        ]
        known = [1 + bias for bias in found if not isnan(bias)]
        return float(np.mean(known)) if known else nan


def asked(subjects: Sequence[str], name: str) -> list[float]:
    """The values of a name in the subjects, ascending."""
    words = [word for subject in subjects for word in subject.split()]
    return sorted({float(word.partition("=")[2]) for word in words if word.startswith(f"{name}=")})


def grids(frame: pd.DataFrame) -> list[Part]:
    """Restitution, friction, both of slow bodies, and a fall under several steps."""
    values = Values(frame)
    parts = (_restitution(values), _friction(values), _slow(values), _drops(frame))
    return [
        replace(one, heads=[head.replace(" ", "\n", 1) for head in one.heads], tight=True) for one in parts
    ]


def _restitution(values: Values) -> Part:
    pairs = [pair.partition("-")[0] for pair in SHAPES]
    biases = [f"{pair} bias" for pair in pairs]
    heads = ["", *(f"asked {e:g}" for e in values.restitutions), *biases, "lowest [m/s]"]
    rows = []
    for column in values.columns:
        subjects = [subject_of("restitution", e, SHOWN_SPEED) for e in values.restitutions]
        achieved = [values(column, "sphere-box", "restitution.achieved", subject) for subject in subjects]
        largest = [values(column, pair, "restitution.bias.max") for pair in SHAPES]
        lowest = values(column, "sphere-box", "restitution.lowest", "e=1")
        rows.append([_name(values, column), *map(_text, [*achieved, *largest, lowest])])
    return Part("restitution, asked and achieved", heads, rows)


def _friction(values: Values) -> Part:
    pairs = [pair.partition("-")[0] for pair in SHAPES]
    heads = ["", *(f"{pair} {heading:g}°" for pair in pairs for heading in values.headings), "bias"]
    rows = []
    for column in values.columns:
        shares = [values.share(column, pair, heading) for pair in SHAPES for heading in values.headings]
        rows.append([_name(values, column), *map(_text, [*shares, values(column, ALL, "friction.bias.max")])])
    return Part("friction, achieved over asked, per heading", heads, rows)


def _slow(values: Values) -> Part:
    """What e = 1 returns per approach speed, and friction per speed of the slip."""
    speeds = [speed for speed in values.speeds if speed <= JUDGED_SPEED]
    heads = ["", *(f"bounce {v:g}" for v in speeds), *(f"slide {v:g}" for v in values.slips), "slide bias"]
    rows = []
    for column in values.columns:
        cells = [
            values(column, "sphere-box", "restitution.achieved", subject_of("restitution", 1.0, v))
            for v in speeds
        ]
        for v in values.slips:
            subjects = [subject_of("slow", mu, v) for mu in values.frictions]
            found = [values(column, pair, "friction.slow", one) for pair in SHAPES for one in subjects]
            known = [one for one in found if not isnan(one)]
            cells.append(float(np.mean(known)) if known else nan)
        cells.append(values(column, ALL, "friction.slow.max"))
        rows.append([_name(values, column), *map(_text, cells)])
    return Part("slow bodies [m/s]: what e = 1 returns, friction achieved over asked", heads, rows)


def _drops(frame: pd.DataFrame) -> Part:
    rows = rows_of(frame[frame.metric == "restitution.drop"])
    steps = sorted({row.dt for row in rows}, reverse=True)
    heads = ["", *(f"{step_text(dt)} s" for dt in steps)]
    lines = []
    for engine in dict.fromkeys(row.engine for row in rows):
        cells = {
            r.dt: f"{_text(r.value)} ({_text(r.low)} to {_text(r.high)})" for r in rows if r.engine == engine
        }
        lines.append([engine, *(cells.get(dt, "-") for dt in steps)])
    return Part(
        "e = 1 from a fall of half a metre, and its range over where within a step bodies land", heads, lines
    )


def _name(values: Values, column: tuple[str, str]) -> str:
    return f"{column[0]} {column[1]} {step_text(values.steps[column])} s"


def _text(value: float) -> str:
    """Three decimals: coefficients are of order 1."""
    return "-" if isnan(value) else f"{value:.3f}"


DART_BOUNCE = 0.1
"""DART bounces where e v is above this (DART_BOUNCING_VELOCITY_THRESHOLD, ContactSurface.hpp) [m/s]."""
BULLET_MARGIN = 0.02
"""Share of a body's size within which Bullet generates contacts (getContactBreakingThreshold) [1]."""
BULLET_BOUNCE = 0.2
"""Bullet's default restitutionVelocityThreshold [m/s]."""

Finding = Callable[[Values, pd.DataFrame], str]


def findings(frame: pd.DataFrame) -> list[str]:
    """One line per finding whose numbers are all in the frame."""
    values = Values(frame)
    lines = [finding(values, frame) for finding in FINDINGS]
    return [line for line in lines if line and "nan" not in line]


def _reference_lowest(values: Values, frame: pd.DataFrame) -> str:
    rest = 2 * G * values.step("reference")
    return (
        f"reference: bounces from {values.lowest('reference'):.3f} m/s on, by its own law: e fades evenly "
        f"from 4 g h = {2 * rest:.3f} m/s to none at 2 g h = {rest:.3f} m/s, with a quarter of it at "
        f"2.5 g h = {1.25 * rest:.3f} m/s"
    )


def _dart_lowest(values: Values, frame: pd.DataFrame) -> str:
    least = DART_BOUNCE - 1.5 * G * values.step("dart")
    return (
        f"dart: bounces from {values.lowest('dart'):.3f} m/s on: it has no bounce unless e v > "
        f"{DART_BOUNCE:g} m/s, where v has fallen on past the surface, for half a step here, and holds one "
        f"more step of gravity: {DART_BOUNCE:g} - 1.5 g h = {least:.3f} m/s. dartpy has no setter. A bounce "
        "gains about 2 g h / v, for gravity pulls in the step before it, not in its own"
    )


def _dart_cone(values: Values, frame: pd.DataFrame) -> str:
    first, accurate = (values.share(column, "box-box", 45.0) for column in values.both("dart"))
    return (
        f"dart: {first:.3f} of mu at 45 degrees, for each of two directions may have all of mu: sqrt(2) "
        f"together. The cone of its NSGS solver is circular (accurate): {accurate:.3f}"
    )


def _bullet_steps(values: Values, frame: pd.DataFrame) -> str:
    drops = [r for r in rows_of(frame[frame.metric == "restitution.drop"]) if r.engine == "bullet"]
    if not drops:
        return ""
    found = ", ".join(f"{r.value:.2f} at {step_text(r.dt)} s" for r in drops)
    accurate = values(("bullet", "accurate"), "sphere-box", "restitution.achieved", "e=1 v=1")
    return (
        f"bullet: loses restitution as the step shrinks: e = 1 from a fall of 0.5 m returns {found}. "
        "Contacts are found before bodies touch, within "
        f"{BULLET_MARGIN:.0%} of their size ({1e3 * _margin():g} mm here), and brake a body "
        "so that it just arrives at the end of the step; what speed it has left is what bounces. Long steps "
        "jump over that margin; they gain by position correction and by a step "
        "without gravity. contactProcessingThreshold = 0 (accurate) takes the margin away: e = 1 returns "
        f"{accurate:.2f} at 1 m/s. Bodies of shifted pieces (compounds) have no margin to begin with"
    )


def _bullet_lowest(values: Values, frame: pd.DataFrame) -> str:
    braked = _margin() / (1.5 * values.step("bullet"))
    return (
        f"bullet: bounces from {values.lowest('bullet'):.3f} m/s on; below restitutionVelocityThreshold = "
        f"{BULLET_BOUNCE:g} m/s not at all, and below {braked:.3f} m/s it needs more than a step and a half "
        "through the margin and is braked twice"
    )


def _margin() -> float:
    """Bullet's margin round the bodies of the study [m]."""
    return BULLET_MARGIN * HEIGHT


def _bullet_cone(values: Values, frame: pd.DataFrame) -> str:
    column, _ = values.both("bullet")
    sphere, box = (values.share(column, pair, 45.0) for pair in ("sphere-box", "box-box"))
    return (
        f"bullet: {sphere:.3f} of mu at 45 degrees under a sphere, {box:.3f} under a box: each point of a "
        "face is on its cone, but in a direction of its own, and they do not add up"
    )


def _bullet_hulls(values: Values, frame: pd.DataFrame) -> str:
    first, accurate = (1e3 * values(column, "hull-box", "gap.rest") for column in values.both("bullet"))
    bias = values(("bullet", "accurate"), "hull-box", "restitution.bias.max")
    return (
        f"bullet: hulls rest {first:.2f} mm high, {accurate:.2f} mm without collisionMargin (accurate). A "
        "hull that lands flat is found one point a step and begins to spin: its restitution is off by up to "
        f"{bias:.2f} even so"
    )


def _mujoco_spring(values: Values, frame: pd.DataFrame) -> str:
    first, accurate = (
        values(column, "sphere-box", "restitution.achieved", "e=0.3 v=5") for column in values.both("mujoco")
    )
    return (
        f"mujoco: e = 0.3 returns {first:.3f} at 5 m/s: a damped spring that may not pull lets go while "
        f"still compressed. Allowing for that, with a stiff contact (accurate): {accurate:.3f}; slow bodies "
        "return less, for they let go below the surface and climb out against gravity"
    )


def _mujoco_cone(values: Values, frame: pd.DataFrame) -> str:
    column, accurate = values.both("mujoco")
    slowest = f"mu={min(values.frictions, default=0):g} heading=45"
    return (
        f"mujoco: {1 + values(column, 'box-box', 'friction.bias', slowest):.3f} of mu at 45 degrees for the "
        "slowest box: the default cone is a pyramid with its edges over the axes, and its sides are "
        "1 / sqrt(2) = 0.707 from its middle. Faster bodies hop, for friction also lifts them. Elliptic "
        f"cone, friction damped by itself (accurate): "
        f"{values.share(accurate, 'box-box', 45.0):.3f} on average"
    )


FINDINGS: tuple[Finding, ...] = (
    _reference_lowest,
    _dart_lowest,
    _dart_cone,
    _bullet_steps,
    _bullet_lowest,
    _bullet_cone,
    _bullet_hulls,
    _mujoco_spring,
    _mujoco_cone,
)


def write_report(frame: pd.DataFrame, path: Path) -> None:
    """Write the page."""
    path.write_text(page(frame), "utf-8")


def report(frame: pd.DataFrame) -> list[Part]:
    """All tables, their notes, and every finding, failure and broken limit."""
    return [*grids(frame), Part(notes=NOTES, lines=["", *findings(frame)]), failures(frame)]


def page(frame: pd.DataFrame) -> str:
    """The study as a page."""
    *tables, _, _ = report(frame)
    remarks = Part("remarks", lines=failure_lines(frame), empty="none")
    tail = (Part(notes=NOTES, picture="calibration.png"), Part("findings", lines=findings(frame)), remarks)
    lines = [
        "# touchstone study calibration",
        *(line for part in (*tables, *tail) for line in markdown(part)),
    ]
    return "\n".join(lines) + "\n"


SIDES = ((2**0.5, "√2"), (0.5**0.5, "1 / √2"))
"""Shares of friction at 45 degrees that reveal a pyramid in place of a cone [1]."""


def requested_and_achieved(frame: pd.DataFrame, path: Path) -> None:
    """Draw achieved over requested restitution and friction per engine.

    Restitution from JUDGED_SPEED: medians over speeds and shapes, with the range over these and over the
    phase within a step at which bodies land. Friction per heading: medians over coefficients and shapes, with
    their range.
    """
    parts = {engine: frame[(frame.engine == engine) & frame.value.notna()] for engine in ENGINES}
    bounced = {engine: _ranges(part, _restitutions, 0.014) for engine, part in parts.items() if len(part)}
    slid = {engine: _ranges(part, _frictions, 1.1) for engine, part in parts.items() if len(part)}
    line = alt.Chart(pd.DataFrame({"x": [0, 1], "middle": [0, 1]})).mark_line(color=PALE, strokeDash=DASHES)
    sides = alt.Chart(pd.DataFrame(SIDES, columns=["middle", "name"])).encode(y="middle:Q")
    text = sides.mark_text(align="left", dx=4, dy=-5, color=PALE).encode(x=alt.value(0), text="name:N")
    levels = rule(DASHES, y=1) + sides.mark_rule(color=PALE, strokeDash=DOTS) + text
    x = axis(alt.X, "x", "restitution asked", (-0.05, 1.05))
    y = axis(alt.Y, "middle", "restitution achieved", _span(bounced, -0.05, 1.05))
    below, legend = line.encode(x="x:Q", y="middle:Q"), alt.Legend(orient="top-left", columns=1)
    panels = [below + _panel(engine, part, x, y, legend) for engine, part in bounced.items()]
    headings: dict[str, Any] = {"values": [0, 22.5, 45], "labelExpr": "datum.value + '°'", "grid": False}
    x = axis(alt.X, "x", "heading of the slide", (-7, 52), **headings)
    y = axis(alt.Y, "middle", "friction achieved / asked", _span(slid, 0.45, 1.5))
    panels += [levels + _panel(engine, part, x, y, None) for engine, part in slid.items()]
    title = "Bodies that land on a floor and slide over it: what engines make of restitution and friction"
    note = (
        "marker: median; bar: range over balls, boxes and hulls, and over speeds from "
        f"{JUDGED_SPEED:g} m/s on (restitution) or the coefficients asked (friction)"
    )
    save(grid(panels, len(bounced)).resolve_scale(fill="independent"), path, title, note)


def _span(found: Mapping[str, pd.DataFrame], low: float, high: float) -> tuple[float, float]:
    whole = pd.concat([pd.DataFrame({"low": [low], "high": [high]}), *found.values()])
    return whole.low.min(), whole.high.max()


Ranges = dict[float, list[float]]
"""Values by their abscissa."""


def _profiles(frame: pd.DataFrame) -> list[tuple[str, bool]]:
    """The first profile, drawn filled, and the accurate one or the next, drawn hollow."""
    names = list(dict.fromkeys(frame.profile))
    second = ACCURATE if ACCURATE in names else next(iter(names[1:]), "")
    return [(names[0], True)] + ([(second, False)] if second not in ("", names[0]) else [])


def _ranges(frame: pd.DataFrame, find: Callable[[pd.DataFrame], Ranges], shift: float) -> pd.DataFrame:
    """Median and range of each list by its abscissa; the first profile a little to the left."""
    rows = []
    for profile, filled in _profiles(frame):
        for place, found in sorted(find(frame[frame.profile == profile]).items()):
            x = place + (-shift if filled else shift)
            rows.append((profile, filled, x, min(found), float(np.median(found)), max(found)))
    return pd.DataFrame(rows, columns=["profile", "filled", "x", "low", "middle", "high"])


def _panel(engine: str, found: pd.DataFrame, x: Any, y: Any, legend: Any) -> Any:
    color = color_of(engine)
    fill = by(alt.Fill, "profile", dict(zip(dict.fromkeys(found.profile), (color, "white"))), legend=legend)
    base = alt.Chart(found).encode(x=x)
    drawn = base.mark_point(stroke=color, size=45, opacity=1).encode(y=y, fill=fill)
    for chosen, look in (("", {"strokeWidth": 5, "strokeOpacity": 0.3}), ("!", {"strokeWidth": 1.3})):
        bars = base.transform_filter(f"{chosen}datum.filled").mark_rule(color=color, **look)
        drawn += bars.encode(y="low:Q", y2="high:Q")
    return drawn.properties(title={"text": engine, "color": color}, width=190, height=190)


def _asked(subject: str) -> tuple[float, float]:
    """The coefficient and the speed or heading that a row's subject names."""
    first, second = (float(word.partition("=")[2]) for word in subject.split())
    return first, second


def _restitutions(frame: pd.DataFrame) -> Ranges:
    found: Ranges = {}
    for row in rows_of(frame[frame.metric == "restitution.achieved"]):
        e, speed = _asked(row.subject)
        if speed >= JUDGED_SPEED:
            found.setdefault(e, []).extend((row.low, row.value, row.high))
    return found


def _frictions(frame: pd.DataFrame) -> Ranges:
    found: Ranges = {}
    for row in rows_of(frame[frame.metric == "friction.bias"]):
        found.setdefault(_asked(row.subject)[1], []).append(1 + row.value)
    return found
