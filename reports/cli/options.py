"""Shared parts of all commands: exit codes, formats, one-line errors, progress."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, nullcontext, redirect_stdout, suppress
from contextvars import ContextVar
from enum import StrEnum
from io import StringIO
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

import typer

if TYPE_CHECKING:
    import pandas as pd

    from touchstone.reports.progress import Progress
    from touchstone.reports.views.render import Part
    from touchstone.scenarios.scenario import Scenario

LIMIT_BROKEN, BAD_INPUT, ENGINE_MISSING, NOT_JUDGED, ENGINE_FAILED = 1, 2, 3, 4, 5
INTERNAL_ERROR, INTERRUPTED, CLOSED_OUTPUT = 70, 130, 141
"""Exit codes. A broken limit takes precedence over an engine that failed, that over a page that could not be
written, unjudged results and a missing engine: 3 or 4 means that nothing else went wrong."""


Format = StrEnum("Format", "table json csv")
FormatOption = Annotated[Format, typer.Option("--format", help="Of what goes to standard output.")]
QuietOption = Annotated[
    bool, typer.Option("--quiet", help="No progress and no table; failures are still printed.")
]

Names = list[str] | None
"""Type of an option or argument that takes names; none are the default that its help states."""
EngineOption = Annotated[Names, typer.Option(help="Engines (default: all).")]
USUAL = ("balanced", "recommended")
UsualProfileOption = Annotated[Names, typer.Option(help="Profiles (default: balanced, recommended).")]
"""Profiles of a study that plays every engine in one."""
JobsOption = Annotated[int | None, typer.Option(min=1, help="Processes (default: one per core).")]
DaskOption = Annotated[str, typer.Option(help="Play on this Dask scheduler (tcp://host:8786), or local.")]
STORE = Path("runs/sweep")
StoreOption = Annotated[Path, typer.Option(help="Folder of all cells; what it holds is not measured again.")]

_any_time: ContextVar[bool] = ContextVar("any_time", default=True)
"""Whether what this command measures may take any time."""


def _remember(yes: bool) -> bool:
    _any_time.set(yes)
    return yes


YesOption = Annotated[
    bool, typer.Option("--yes", callback=_remember, help="Play what takes longer than a night, too.")
]

PrintedOutOption = Annotated[
    Path | None, typer.Option("--out", help="New file to write (default: standard output).")
]


def stop(message: str, code: int = BAD_INPUT) -> NoReturn:
    """Exit with one line on standard error."""
    with suppress(OSError):  # standard error may be full or closed
        print(f"touchstone: {message}", file=sys.stderr)
    sys.exit(code)


@contextmanager
def refusing(*refusals: type[Exception]) -> Iterator[None]:
    """Exceptions that say what is wrong with the input exit with their one line."""
    try:
        yield
    except refusals as error:
        stop(str(error))


def require_new(path: Path, option: str = "--out") -> None:
    """Exit with one line if a file that is to be written exists."""
    if path.exists():
        stop(f"{option} {path}: exists")


def write_file(path: Path, write: Callable[[Path], object], option: str = "--out") -> None:
    """Call `write` on a temporary file, and rename it to `path`; a disk error exits with one line."""
    from touchstone.reports.results import write_beside

    try:
        write_beside(path, write)
    except OSError as error:
        stop(f"{option} {path}: {error.strerror or error}")


@contextmanager
def output_to(path: Path | None) -> Iterator[None]:
    """Write what goes to standard output to a new file; also where the command ends with a verdict."""
    if path is None:
        yield
        return
    require_new(path)
    text = StringIO()
    try:
        with redirect_stdout(text):
            yield
    finally:
        if not isinstance(sys.exc_info()[1], (SystemExit, KeyboardInterrupt)):
            write_file(path, lambda part: part.write_text(text.getvalue(), "utf-8"))


def known(kind: str, name: str, valid: Iterable[str]) -> str:
    """The name, if valid; else exit 2 with one line of the nearest valid names."""
    from touchstone.scenarios.names import checked

    with refusing(ValueError):
        checked(kind, name, valid)
    return name


def columns_for(engines: Names, profiles: Names, default: Iterable[str] = ()) -> tuple[tuple[str, str], ...]:
    """(engine, profile) columns of the named engines (none: all) and profiles (none: `default`, or all).

    Where no profile is named, an engine that has none of `default` plays its first. A named engine without
    the named profiles, and a named profile without an engine, exit with one line.
    """
    from touchstone.adapters.registry import ENGINES
    from touchstone.reports.runner.request import columns_of

    names = engines_named(engines or ()) or list(ENGINES)
    every = dict.fromkeys(profile for entry in ENGINES.values() for profile in entry.profiles)
    wanted = [known("profile", name, every) for name in dict.fromkeys(profiles or ())]
    asked = wanted or list(default)
    # Without names, each engine uses its profiles in its own order.
    columns = columns_of(names, asked) if asked else tuple((e, p) for e in names for p in ENGINES[e].profiles)
    if not wanted:
        lacking = (name for name in names if name not in dict(columns))
        columns += tuple((name, next(iter(ENGINES[name].profiles))) for name in lacking)
    idle = [name for name in names if name not in dict(columns)]
    if wanted and idle and (engines or not columns):
        valid = ", ".join(dict.fromkeys(profile for name in idle for profile in ENGINES[name].profiles))
        stop(f"no engine of {', '.join(idle)} has the profile {', '.join(wanted)} (valid: {valid})")
    if absent := [profile for profile in wanted if profile not in {profile for _, profile in columns}]:
        stop(f"no engine of {', '.join(names)} has the profile {', '.join(absent)}")
    return columns


def engines_named(names: Iterable[str]) -> list[str]:
    """The engines, registered; an unknown one, or a plug-in that cannot be loaded, exits with one line."""
    from touchstone.adapters.contract import AdapterError
    from touchstone.adapters.registry import registered

    found = []
    for name in dict.fromkeys(names):
        with refusing(AdapterError):
            found.append(registered(name))
    return list(dict.fromkeys(found))


def engine_installed(name: str) -> str:
    """The engine, registered; one that is not installed exits with how to install it."""
    from touchstone.adapters.registry import installed, missing_reason

    engine = engines_named([name])[0]
    if not installed(engine):
        stop(f"{engine}: {missing_reason(engine)}", ENGINE_MISSING)
    return engine


def with_settings(columns: tuple[tuple[str, str], ...], wanted: Iterable[str]) -> tuple[tuple[str, str], ...]:
    """The columns without the profiles that have no settings, of engines for which one is wanted."""
    from touchstone.adapters.registry import settings_of

    asked = {text.partition("=")[0].rpartition(".")[0].strip() for text in wanted}
    return tuple(
        (engine, profile)
        for engine, profile in columns
        if not (asked & {"", engine} and settings_of(engine).is_bare(profile))
    )


def changes_for(columns: Iterable[tuple[str, str]], wanted: Iterable[str]) -> tuple[str, ...]:
    """Changed settings ("key=value" or "engine.key=value") for all columns; invalid ones exit with one
    line."""
    from touchstone.adapters.knobs import SettingError
    from touchstone.adapters.registry import changes_of

    texts = tuple(wanted)
    try:
        for engine, profile in columns if texts else ():
            changes_of(engine, profile, texts)
    except SettingError as error:
        stop(f"--set {error}; ENGINE.KEY=VALUE sets that of one engine")
    return texts


def step_for(text: str, scenarios: Iterable[Scenario]) -> float:
    """A step such as 1/240; it must divide the frame of every scene."""
    from fractions import Fraction

    from touchstone.adapters.recorder import substeps

    shown = " ".join(text.split())
    try:
        value = float(Fraction(text if text.isascii() and "_" not in text else ""))
    except (ValueError, ZeroDivisionError, OverflowError):
        stop(f"--dt {shown}: expected a step in seconds, such as 1/240 or 0.005")
    try:
        for scenario in scenarios:
            substeps(scenario, value)
    except (ValueError, ZeroDivisionError, OverflowError) as error:
        stop(f"--dt {shown}: {error}")
    return value


def effects_for(text: str) -> tuple[str, ...] | None:
    """The requested effects: None for "auto", or names in the order of a plan."""
    from touchstone.scenarios.effects import PLANNED

    if text == "auto":
        return None
    if text == "all":
        return PLANNED
    named = [known("effect", name.strip(), ["auto", "all", *PLANNED]) for name in text.split(",")]
    return tuple(effect for effect in PLANNED if effect in named)


def printed(frame: pd.DataFrame, output: Format) -> bool:
    """Print the long table in a machine format; False for the human format."""
    if output is Format.json:
        print(frame.to_json(orient="records", indent=1, double_precision=15))
    elif output is Format.csv:
        print(frame.to_csv(index=False), end="")
    return output is not Format.table


def show(parts: Iterable[Part], *lines: str) -> None:
    """Print the parts of a report, and lines below them."""
    from touchstone.reports.views.render import console, print_parts

    print_parts(parts, console())
    for line in lines:
        print(line)


def version() -> str:
    """Version of the program."""
    from touchstone.adapters.engines.reference import ENTRY
    from touchstone.reports.machine import package_version

    return package_version(ENTRY.distribution, "not installed")


FOLDERS = count(1)


def folder_of_now(prefix: str = "") -> Path:
    """Default folder of results: runs/<prefix><time>-<process>, with a number from a process's second on; two
    runs of one second have two folders."""
    import os
    from datetime import datetime

    number = next(FOLDERS)
    again = f"-{number}" if number > 1 else ""
    return Path("runs") / f"{prefix}{datetime.now():%Y-%m-%dT%H-%M-%S}-{os.getpid()}{again}"


def exit_for(verdicts: Iterable[str], by_name: bool, faults: bool = False) -> None:
    """Exit with the code of the verdicts; `by_name`: the user named the engines; `faults`: the program could
    not write one of its own pages.

    An engine that is installed but cannot be imported counts as named: it was meant to play.
    """
    from touchstone.adapters.contract import MISSING, UNIMPORTABLE
    from touchstone.reports.results import UNJUDGED

    found = set(verdicts)
    if "fail" in found:
        raise typer.Exit(LIMIT_BROKEN)
    if "error" in found:
        raise typer.Exit(ENGINE_FAILED)
    if faults:
        raise typer.Exit(INTERNAL_ERROR)
    if UNJUDGED in found:
        raise typer.Exit(NOT_JUDGED)
    if UNIMPORTABLE in found or (by_name and MISSING in found):
        raise typer.Exit(ENGINE_MISSING)


def tell_failures(frame: pd.DataFrame, by_name: bool = False) -> None:
    """Print on standard error what decides the exit code: broken limits, failed runs, engines that did not
    play, and why figures are not judged."""
    from touchstone.adapters.contract import MISSING, UNIMPORTABLE
    from touchstone.reports.results import UNJUDGED

    told = ["fail", "error", UNJUDGED, UNIMPORTABLE, *([MISSING] if by_name else [])]
    lines: dict[str, None] = {}
    for row in frame[frame.verdict.isin(told)].to_dict("records"):
        where, reason = f"{row['scenario']} {row['engine']} {row['profile']}", row["reason"]
        if row["verdict"] in (MISSING, UNIMPORTABLE):
            where = row["engine"]
        elif row["verdict"] == UNJUDGED:
            where = "some figures"
        elif row.get("metric", "run") != "run":
            what = f"{row['metric']} {row['subject']}".strip()
            reason = f"{what} {row['value']:.4g}, limit {row['limit']:.4g}: {reason}"
        lines[f"{row['verdict']}: {where}: {reason}"] = None
    for line in lines:
        print(line, file=sys.stderr)


def progress_for(total: int, quiet: bool, by_scene: bool = False):  # type: ignore[no-untyped-def]
    """Progress on standard error over a total of steps; off a terminal one line per scene or per task."""
    from touchstone.reports.progress import bar, lines, quietly

    if quiet:
        return nullcontext(quietly)
    return bar(total) if sys.stderr.isatty() else lines(by_scene)


def require_judge() -> None:
    """Exit with one line if a library is missing that judges a study's measurements."""
    from touchstone.reports.metrics.context import judge_faults

    if faults := judge_faults():
        stop("; ".join(faults), NOT_JUDGED)


class Interrupted(SystemExit):
    """Ctrl-C, or a signal that ends a run as it does; the text says what is kept."""


@contextmanager
def resumable(store: Path) -> Iterator[None]:
    """Ctrl-C ends a sweep with one line that says what is kept."""
    try:
        yield
    except KeyboardInterrupt:
        raise Interrupted(f"what was measured is kept in {store}, the same command goes on") from None


@contextmanager
def measuring(total: int, quiet: bool, *refusals: type[Exception]) -> Iterator[Progress]:
    """Progress over a total of steps; an input that a study refuses, a disk error, or a study that would take
    longer than STUDY_LONGEST without `--yes`, exits with one line."""
    from touchstone.reports.output_folder import OutputError
    from touchstone.reports.runner.request import STUDY_LONGEST, TooLargeError, limited

    with refusing(OutputError, TooLargeError, *refusals), progress_for(total, quiet) as progress:
        yield progress if _any_time.get() else limited(progress, total, STUDY_LONGEST, "steps")


def ended(
    frame: pd.DataFrame,
    report: Callable[[pd.DataFrame], list[Part]],
    folder: Path,
    output: Format,
    quiet: bool,
    by_name: bool = False,
) -> None:
    """Print the measurements, and exit with the code of their verdicts (`exit_for`)."""
    if not printed(frame, output) and not quiet:
        show(report(frame), f"results: {folder}")
    if quiet:
        tell_failures(frame, by_name)
    exit_for(frame.verdict, by_name)
