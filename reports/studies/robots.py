"""Import every robot below some folders, and compare each scene with its file."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import replace
from math import nan
from pathlib import Path

import pandas as pd

from touchstone.adapters.oracles.robot_file import EQUAL, READERS, deviations, trees_of
from touchstone.adapters.robots.mechanism import Simulated
from touchstone.adapters.robots.robot_error import RobotError
from touchstone.adapters.robots.robot_scene import NOTHING_MOVES, Imported, imported
from touchstone.adapters.robots.source import compiled
from touchstone.reports.output_folder import output_folder
from touchstone.reports.progress import Progress
from touchstone.reports.results import Row, rows_of
from touchstone.reports.studies.study import kept
from touchstone.reports.views.render import Part

STUDY = "import"
SUFFIXES = (".urdf", ".mjcf", ".xml")
ROOTS = {"urdf": rb"<robot[\s>]", "mjcf": rb"<mujoco[\s>]"}
"""Start of the root element of each form; files of `<mujocoinclude>` are parts of others."""
MOST_HEAD = 65536
"""Bytes in which a root element must begin: comments precede it."""
FOLDERS = re.compile(r"(?<![\w.-])/[^':]*/")
"""Absolute folders in a message, which a table for others leaves out."""
REASON = "the file says so"


def robots_below(folders: Iterable[Path]) -> dict[str, tuple[Path, str]]:
    """Name -> path and form of each robot below the folders: folder and file, with what is between where
    several files have one name."""
    found: list[tuple[Path, Path, str]] = []
    for folder in folders:
        files = (one for one in folder.rglob("*") if one.suffix.lower() in SUFFIXES and one.is_file())
        for path in sorted(files):
            head = path.open("rb").read(MOST_HEAD)
            form = next((form for form, root in ROOTS.items() if re.search(root, head)), "")
            if form:
                found.append((Path(folder.resolve().name) / path.relative_to(folder), path, form))
    short = Counter(Path(name.parts[0]) / name.name for name, _, _ in found)
    names = ((Path(name.parts[0]) / name.name, name) for name, _, _ in found)
    return {
        str(brief if short[brief] == 1 else name): (path, form)
        for (brief, name), (_, path, form) in zip(names, found)
    }


def run(
    robots: dict[str, tuple[Path, str]],
    out: Path,
    allow_paths: bool,
    simulated: Simulated | None,
    progress: Progress,
) -> pd.DataFrame:
    """Check all robots; the folder appears complete or not at all."""
    rows: list[Row] = []
    with output_folder(out) as folder:
        for name, (path, form) in robots.items():
            progress(name, 1)
            rows += rows_of_robot(name, path, form, allow_paths, simulated)
        return kept(rows, folder, {"study": STUDY})


def rows_of_robot(
    name: str, path: Path, form: str, allow_paths: bool, simulated: Simulated | None = None
) -> list[Row]:
    """A row per quantity with its deviation, or one with the reason why the file is refused."""
    base = Row(STUDY, name, READERS[form], form, nan, "run")
    try:
        found = imported(path, "robot", allow_paths, simulated)
        off = checked(path, found, allow_paths)
    except RobotError as error:
        lines = FOLDERS.sub("", str(error).replace(f"{path.parent}/", "")).splitlines()
        more = f" (and {len(lines) - 1} more)" if len(lines) > 1 else ""
        return [replace(base, verdict="skipped", reason=lines[0] + more)]
    except Exception as error:  # one file must not take the table with it
        return [replace(base, verdict="error", reason=f"{type(error).__name__}: {error}".splitlines()[0])]
    mass = sum(body.mass for body in found.scenario.bodies if body.kind != "fixed")
    facts = (
        ("joints", len(found.scenario.joints) + len(found.scenario.body_joints), "1"),
        ("mass", mass, "kg"),
        ("notes", len(found.notes), "1"),
    )
    rows = [replace(base, metric="robot", subject=s, value=value, unit=unit) for s, value, unit in facts]
    for quantity, value in off.items():
        verdict = "pass" if value <= EQUAL else "fail"
        row = replace(base, metric=f"robot.{quantity}", value=value, unit="1", limit=EQUAL)
        rows.append(replace(row, verdict=verdict, reason=REASON))
    return rows


def checked(path: Path, found: Imported, allow_paths: bool) -> dict[str, float]:
    """Deviation of an imported scene from its file per quantity [1]; raises RobotError where a reader
    refuses it."""
    return deviations(found, trees_of(path, compiled(path, allow_paths), found.scenario))


def verdict_line(form: str, off: dict[str, float]) -> str:
    """What the comparison of one robot found, as a sentence."""
    differs: Sequence[str] = [f"{name} by {value:.1e}" for name, value in off.items() if value > EQUAL]
    if differs:
        return f"differs from what {READERS[form]} reads in the file: {', '.join(differs)}"
    error = f"{max(max(off.values()), 1e-17):.0e}"
    return f"checked: {', '.join(off)} as {READERS[form]} reads them in the file, to {error}"


HEADS = ("robot", "result", "deviation", "joints", "mass [kg]", "notes")
RESULTS = {"skipped": "refused", "error": "error"}
NOTES = (
    "deviation: the largest of mass, centre, inertia (start and two random postures), axes and limits of "
    "joints from the file, relative to the robot's mass, size or inertia; equal: at most 1e-9",
    f"no robot: {NOTHING_MOVES}, as in a file of materials or a mount",
    "notes: lines of `touchstone import` about what a scene does not keep",
)


def report(frame: pd.DataFrame) -> list[Part]:
    """A line per robot, what differs, and the reason of each that is refused."""
    lines = []
    counts: dict[str, Counter[str]] = {}
    remarks = []
    for name, part in frame.groupby("scenario", sort=False):
        rows = {row.metric + row.subject: row for row in rows_of(part)}
        first = next(iter(rows.values()))
        result = RESULTS.get(first.verdict, "equal")
        if first.reason.endswith(NOTHING_MOVES):
            result = "no robot"
        cells = ["", "", "", ""]
        if result == "equal":
            off = {metric: row for metric, row in rows.items() if row.limit == row.limit}
            apart = [f"{m.partition('.')[2]} by {r.value:.1e}" for m, r in off.items() if r.verdict == "fail"]
            result = "differs" if apart else result
            joints, mass, notes = (rows[f"robot{fact}"].value for fact in ("joints", "mass", "notes"))
            largest = max(row.value for row in off.values())
            cells = [f"{largest:.0e}", f"{joints:.0f}", f"{mass:.4g}", f"{notes:.0f}"]
            remarks += [f"differs: {name}: {', '.join(apart)}"] if apart else []
        elif result != "no robot":
            remarks.append(f"{result}: {name}: {first.reason}")
        counts.setdefault(str(name).partition("/")[0], Counter())[result] += 1
        lines.append([str(name), result, *cells])
    totals = [_total(folder, found) for folder, found in counts.items()]
    whole = _total("all", sum(counts.values(), Counter()))
    totals = [*totals, whole] if len(totals) > 1 else [whole.removeprefix("all: ")]
    return [Part("robots, compared with their files", HEADS, lines, NOTES, [*totals, *remarks], words=2)]


def _total(folder: str, found: Counter[str]) -> str:
    """Counts of a folder: robots that are equal first."""
    rest = "".join(f", {found[one]} {one}" for one in sorted(found) if one != "equal")
    return f"{folder}: {found['equal']} equal{rest}"
