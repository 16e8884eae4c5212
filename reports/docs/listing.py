"""Plain lists for `touchstone list` and `show`."""

from __future__ import annotations

import csv
import json
import os
import shutil
import sys
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from math import inf
from typing import Literal

from touchstone.reports.machine import package_version
from touchstone.scenarios.scenario import UNBOUNDED, Scenario, Vector

ARCS_SHOWN = 6
LAWS = {
    "torque_free": "turns freely, by elliptic functions",
    "coupling": "follows its tracker by Eq. 6, solved in closed form",
    "carried": "sticks to or slides on the prescribed body, by Coulomb's law",
    "turntable": "rolls on the turning body, its centre on a circle",
    "smooth_contact": "rolls, slides and leaves, integrated to rounding",
    "rolling_cone": "rolls on its side, integrated to rounding",
    "tipping": "tips from edge to edge, each of which takes the same share of the rate",
    "mechanism": "moves with its joints, integrated to rounding",
    "stick_slip": "sticks to the moving surface, and slips on it by its spring",
}


def engine_rows() -> list[dict[str, object]]:
    """Engines with their versions, and how to install those that are not."""
    from touchstone.adapters.registry import ENGINES, OURS, available, distribution, installed, missing_reason

    rows: list[dict[str, object]] = []
    for name in available():
        # The module of a plug-in that is merely declared is not imported.
        there = name not in (*ENGINES, *OURS) or installed(name)
        found = package_version(distribution(name), "-") if there else "-"
        rows.append({"engine": name, "version": found, "missing": "" if there else missing_reason(name)})
    return rows


def show_rows(rows: Sequence[Mapping[str, object]], output: str) -> None:
    """Print rows as JSON, CSV or a table; a narrower terminal gets wrapped cells, or a block for each row."""
    heads = list(rows[0]) if rows else []
    if output == "json":
        print(json.dumps(list(rows), indent=1))
    elif output == "csv":
        writer = csv.DictWriter(sys.stdout, fieldnames=heads, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    else:
        cells = {head: [head, *(str(row[head]) for row in rows)] for head in heads}
        widths = {head: max(map(len, column)) for head, column in cells.items()}
        words = [max(len(word) for cell in column for word in cell.split()) for column in cells.values()]
        room = _room() - 2 * (len(heads) - 1)
        if sum(widths.values()) <= room:
            for line in zip(*cells.values(), strict=True):
                print("  ".join(map(str.ljust, line, widths.values())).rstrip())
        elif widths[heads[0]] + sum(words[1:]) <= room:
            _show_wrapped(rows, words)
        else:
            _show_blocks(rows)


def _room() -> float:
    """Width of the terminal, or as COLUMNS says; without both, as in a pipe, lines may be of any length."""
    width = os.environ.get("COLUMNS", "")
    if not sys.stdout.isatty() and not width.isdigit():
        return inf
    return shutil.get_terminal_size().columns


def _show_wrapped(rows: Sequence[Mapping[str, object]], words: Sequence[int]) -> None:
    """Print rows as a table that wraps between words; names in the first column and numbers stay whole."""
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(box=None, padding=(0, 0, 0, 2), pad_edge=False, header_style="")
    for k, head in enumerate(rows[0]):
        number = all(isinstance(row[head], int | float) for row in rows)
        justify: Literal["right", "left"] = "right" if number else "left"
        table.add_column(Text(head), justify=justify, no_wrap=number or k == 0, min_width=words[k])
    for row in rows:
        table.add_row(*(Text(str(value)) for value in row.values()))
    Console(width=shutil.get_terminal_size().columns).print(table)


def _show_blocks(rows: Sequence[Mapping[str, object]]) -> None:
    """Print each row as lines of a column's name and its value: words do not fit beside each other."""
    width = max(map(len, rows[0]))
    for k, row in enumerate(rows):
        if k:
            print()
        for head, value in row.items():
            print(f"{head:{width}}  {value}".rstrip())


def scenario_rows() -> list[dict[str, object]]:
    """Scenes with tags, durations and kinds of truth; broken ones are named on standard error."""
    from touchstone.scenarios.catalogue import catalogue, faults

    for line in faults():
        print(f"touchstone: {line}", file=sys.stderr)
    return [
        {
            "scenario": s.name,
            "tags": " ".join(s.tags),
            "duration [s]": s.duration,
            "truth": " ".join(dict.fromkeys(truth.law for truth in s.truths)),
            "summary": s.summary,
        }
        for s in catalogue().values()
    ]


def tag_rows() -> list[dict[str, object]]:
    """Tags with the number of their scenes, and what these have in common."""
    from touchstone.scenarios.catalogue import TAGS, tagged

    counts = {tag: sum(1 for _ in tagged(tag)) for tag in TAGS}
    return [{"tag": tag, "scenes": counts[tag], "in common": text} for tag, text in TAGS.items()]


def metric_rows() -> list[dict[str, object]]:
    """Metrics with units and definitions."""
    from touchstone.reports.metrics import METRICS

    return [
        {"metric": m.name, "unit": m.unit, "better": m.better, "definition": m.formula}
        for m in METRICS.values()
    ]


def profile_rows() -> list[dict[str, object]]:
    """Profiles of every engine with their native steps."""
    from touchstone.adapters.registry import ENGINES
    from touchstone.reports.runner.request import step_text

    return [
        {"profile": profile, "engine": name, "step [s]": step_text(dt)}
        for name, entry in ENGINES.items()
        for profile, dt in entry.profiles.items()
    ]


def setting_rows() -> list[dict[str, object]]:
    """The settings of every engine, with their values in the profiles in which they do something."""
    from touchstone.adapters.registry import ENGINES, settings_of

    rows: list[dict[str, object]] = []
    for engine in ENGINES:
        table = settings_of(engine)
        for setting in table.values():
            values: dict[str, list[str]] = {}
            for profile in table.profiles:
                if setting.name in (acting := table.values_of(profile)):
                    values.setdefault(acting[setting.name] or "by scene", []).append(profile)
            whole = sum(map(len, values.values())) == len(table.profiles)
            shown = (
                f"{value} ({', '.join(profiles)})" if len(values) > 1 or not whole else value
                for value, profiles in values.items()
            )
            rows.append(
                {
                    "engine": engine,
                    "setting": setting.name,
                    "values": setting.valid,
                    "in the profiles": "; ".join(shown),
                    "meaning": setting.summary,
                }
            )
    return rows


def failing_rows() -> list[dict[str, object]]:
    """Number of known failings per engine: causes, and profiles, scenes and metrics in which they show."""
    from touchstone.reports.verdict.failings import known

    rows: list[dict[str, object]] = []
    for engine in dict.fromkeys(one.engine for one in known().values()):
        mine = [one for one in known().values() if one.engine == engine]
        profiles = Counter(one.profile for one in mine).most_common()
        rows.append(
            {
                "engine": engine,
                "causes": len({one.cause for one in mine}),
                "rows": sum(one.largest is not None or not one.has_size for one in mine),
                "scenes": len({one.scenario for one in mine}),
                "of the harness": sum(one.is_harness for one in mine),
                "in the profiles": "; ".join(f"{profile} {count}" for profile, count in profiles),
            }
        )
    return rows


LISTS: dict[str, Callable[[], list[dict[str, object]]]] = {
    "scenarios": scenario_rows,
    "tags": tag_rows,
    "engines": engine_rows,
    "metrics": metric_rows,
    "profiles": profile_rows,
    "settings": setting_rows,
    "failings": failing_rows,
}


def effect_rows(scenario: Scenario, measured: bool = False) -> list[dict[str, object]]:
    """Whether each effect runs in a scene, and the reason; if `measured`, what it costs of a frame of the
    reference, too."""
    from touchstone.adapters.motion_bounds import bounds
    from touchstone.scenarios.plan import plan

    decisions = plan(scenario, bounds(scenario)).decisions
    rows: list[dict[str, object]] = [{"effect": one.effect, "plan": one.state} for one in decisions]
    if measured:
        from touchstone.reports.studies.effects import costs

        found = costs(scenario)
        for row, one in zip(rows, decisions):
            row["cost [%]"] = str(round(100 * found[one.effect])) if one.effect in found else ""
    return [row | {"because": one.reason} for row, one in zip(rows, decisions)]


def loop_line(scenario: Scenario) -> str:
    """What the joints' loops leave open; empty if nothing."""
    from touchstone.scenarios.body_joints import equation_count, implied_equations

    implied = implied_equations(scenario)
    count = equation_count(scenario)
    text = f"redundant loops: others imply {implied} of the joints' {count} equations; the least forces count"
    return text if implied else ""


def joint_rows(scenario: Scenario) -> list[dict[str, object]]:
    """The joints between bodies: what they connect, where, and their limits and forces."""
    from touchstone.scenarios.body_joints import ALONG_AXIS

    rows: list[dict[str, object]] = []
    for joint in scenario.body_joints:
        low, high = (f"{x:.4g}" if abs(x) < UNBOUNDED else "" for x in (joint.lower, joint.upper))
        forces = {
            "k": (joint.stiffness, joint.stiffness),
            "target": (joint.target, joint.stiffness),
            "c": (joint.damping, joint.damping),
            "rate": (joint.target_rate, joint.damping),
            "at most": (joint.largest_force, joint.largest_force < UNBOUNDED),
        }
        shown = (f"{name} {value:.4g}" for name, (value, acts) in forces.items() if acts and value)
        row: dict[str, object] = {
            "joint": joint.name,
            "type": joint.type,
            "parent": joint.parent or "(world)",
            "child": joint.child,
            "anchor [m]": _numbers(joint.anchor),
            "axis": _numbers(joint.axis) if joint.type in ALONG_AXIS else "",
            "limits": f"{low} to {high}" if low or high else "",
            "forces": ", ".join(shown),
        }
        if any(one.mimics for one in scenario.body_joints):
            row["coupling"] = f"{joint.ratio:g} times {joint.mimics}" if joint.mimics else ""
        rows.append(row)
    return rows


def surface_lines(scenario: Scenario) -> Iterator[str]:
    """The motion of each surface relative to its body, in words and numbers."""
    for body in scenario.bodies:
        for piece in body.pieces:
            rates = ((piece.surface_velocity, "m/s"), (piece.surface_angular_velocity, "rad/s"))
            shown = [f"{_numbers(rate)} {unit}" for rate, unit in rates if any(rate)]
            if shown:
                yield f"surface of {body.name}.{piece.name} moves at {' and '.join(shown)}"


def truth_lines(scenario: Scenario) -> Iterator[str]:
    """The closed-form motion of each body, and the stated forces, in words and numbers."""
    for truth in scenario.truths:
        if truth.law != "arcs":
            yield f"truth {truth.body}: {LAWS[truth.law]}"
        for arc in truth.arcs[:ARCS_SHOWN]:
            rates = (
                ("v", arc.velocity, "m/s"),
                ("a", arc.acceleration, "m/s^2"),
                ("w", arc.angular_velocity, "rad/s"),
                ("dw/dt", arc.angular_acceleration, "rad/s^2"),
            )
            shown = [f"{name} = {_numbers(value)} {unit}" for name, value, unit in rates if any(value)]
            at = f"truth {truth.body}: from {arc.start:.6g} s at {_numbers(arc.position)} m"
            yield ", ".join([at, *(shown or ["at rest"])])
        if len(truth.arcs) > ARCS_SHOWN:
            yield f"truth {truth.body}: {len(truth.arcs) - ARCS_SHOWN} arcs more"
    for force in scenario.forces:
        unit = "N" if force.quantity == "force" else "N s"
        window = f"from {force.start:g} to {force.end:g} s"
        yield f"truth {force.body}-{force.other}: {force.quantity} {force.value:.6g} {unit} {window}"
    for one in scenario.published:
        yield f"published {one.name}: {one.value:.6g} {one.unit} to {one.tolerance:.3g}; {one.source}"


def _numbers(vector: Vector) -> str:
    return "(" + ", ".join(f"{value + 0.0:.6g}" for value in vector) + ")"
