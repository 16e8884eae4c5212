"""Plain lists for `touchstone list` and `show`."""

from __future__ import annotations

import csv
import json
import sys
from collections.abc import Iterator, Mapping, Sequence

from touchstone.scenarios.scenario import Scenario, Vector

ARCS_SHOWN = 6
"""Largest number of arcs of a closed form that are printed."""
LAWS = {
    "torque_free": "turns freely, by elliptic functions",
    "coupling": "follows its tracker by Eq. 6, solved in closed form",
}


def show_rows(rows: Sequence[Mapping[str, object]], output: str) -> None:
    """Print rows as a table, JSON or CSV."""
    heads = list(rows[0]) if rows else []
    if output == "json":
        print(json.dumps(list(rows), indent=1))
    elif output == "csv":
        writer = csv.DictWriter(sys.stdout, fieldnames=heads, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    else:
        widths = {head: max(len(head), *(len(str(row[head])) for row in rows)) for head in heads}
        for row in ({head: head for head in heads}, *rows):
            print("  ".join(f"{row[head]!s:{widths[head]}}" for head in heads).rstrip())


def effect_rows(scenario: Scenario) -> list[dict[str, object]]:
    """Whether each effect runs in a scene, and the reason."""
    from touchstone.adapters.motion_bounds import bounds
    from touchstone.scenarios.effects import plan

    decisions = plan(scenario, bounds(scenario)).decisions
    return [{"effect": one.effect, "plan": one.state, "because": one.reason} for one in decisions]


def truth_lines(scenario: Scenario) -> Iterator[str]:
    """The closed-form motion of each body, in words and numbers."""
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
            told = [f"{name} = {_numbers(value)} {unit}" for name, value, unit in rates if any(value)]
            at = f"truth {truth.body}: from {arc.start:.6g} s at {_numbers(arc.position)} m"
            yield ", ".join([at, *(told or ["at rest"])])
        if len(truth.arcs) > ARCS_SHOWN:
            yield f"truth {truth.body}: {len(truth.arcs) - ARCS_SHOWN} arcs more"


def _numbers(vector: Vector) -> str:
    return "(" + ", ".join(f"{value + 0.0:.6g}" for value in vector) + ")"
