"""`touchstone`: the only file that knows every layer. Heavy imports wait until a command needs them."""

from __future__ import annotations

import difflib
import sys
from collections.abc import Iterable
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

import typer

if TYPE_CHECKING:
    import pandas as pd

    from reports.run import Request
    from scenarios.scenario import Scenario

app = typer.Typer(
    help="Contact handling of avatars: a reference, and what DART, Bullet and MuJoCo make of its scenes.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)

LIMIT_BROKEN, BAD_INPUT, NOT_INSTALLED, INTERRUPTED = 1, 2, 3, 130


class Format(StrEnum):
    """Formats of machine and human output."""

    table = "table"
    json = "json"
    csv = "csv"


class Listing(StrEnum):
    """What `list` can list."""

    scenarios = "scenarios"
    engines = "engines"
    metrics = "metrics"
    profiles = "profiles"


FormatOption = Annotated[Format, typer.Option("--format", help="Of what goes to standard output.")]


def main() -> None:
    """Entry point: every expected failure ends in one line on standard error."""
    try:
        app()
    except (KeyboardInterrupt, SystemExit) as end:
        # typer turns Ctrl-C into a silent exit
        if isinstance(end, SystemExit) and end.code != INTERRUPTED:
            raise
        _stop("interrupted; nothing was written", INTERRUPTED)


def _stop(message: str, code: int) -> NoReturn:
    print(f"touchstone: {message}", file=sys.stderr)
    sys.exit(code)


def _known(kind: str, name: str, valid: Iterable[str]) -> str:
    """The name, if valid; else one line with the nearest valid names, exit 2."""
    names = list(valid)
    if name in names:
        return name
    near = difflib.get_close_matches(name, names, n=3, cutoff=0.5)
    hint = f"; did you mean {' or '.join(repr(n) for n in near)}?" if near else ""
    _stop(f"unknown {kind} {name!r}{hint} (valid: {', '.join(names)})", BAD_INPUT)


@app.command()
def run(
    scenario: Annotated[list[str] | None, typer.Argument(help="Scenes to play (default: --tag).")] = None,
    tag: Annotated[str, typer.Option(help="Play every scene with this tag.")] = "gallery",
    engine: Annotated[list[str] | None, typer.Option(help="Engines (default: all installed).")] = None,
    profile: Annotated[
        list[str] | None, typer.Option(help="Profiles (default: balanced, recommended, equal-step).")
    ] = None,
    metric: Annotated[list[str] | None, typer.Option(help="Report these metrics alone.")] = None,
    dt: Annotated[str | None, typer.Option(help="Native step of every engine, such as 1/240 [s].")] = None,
    out: Annotated[Path | None, typer.Option(help="Folder of results (default: runs/<time>).")] = None,
    output: FormatOption = Format.table,
    quiet: Annotated[bool, typer.Option("--quiet", help="No progress and no table.")] = False,
) -> None:
    """Play scenes on engines and show where they differ."""
    from reports.output import OutputError
    from reports.run import run as run_study

    request = _request(scenario or [], tag, engine or [], profile or [], metric or [], dt, out)
    try:
        frames = sum(s.frame_count for s in request.scenarios) * len(request.columns)
        with _progress(frames, quiet) as progress:
            results = run_study(request, progress)
    except OutputError as error:
        _stop(str(error), BAD_INPUT)
    if not _printed(results.frame, output) and not quiet:
        from reports.terminal import console, show

        shown = set(request.columns) if profile else {c for c in request.columns if c[1] != "equal-step"}
        show(results.frame, console(), shown)
        print(f"results: {request.out}")
    _exit_for(results.frame.verdict, results.frame.reason, bool(engine))


def _printed(frame: pd.DataFrame, output: Format) -> bool:
    """Print the long table for machines; False where a human asked."""
    if output is Format.json:
        print(frame.to_json(orient="records", indent=1, double_precision=15))
    elif output is Format.csv:
        print(frame.to_csv(index=False), end="")
    return output is not Format.table


def _folder_of_now(prefix: str = "") -> Path:
    from datetime import datetime

    return Path("runs") / f"{prefix}{datetime.now():%Y-%m-%dT%H-%M-%S}"


def _exit_for(verdicts: Iterable[str], reasons: Iterable[str], by_name: bool) -> None:
    pairs = list(zip(verdicts, reasons))
    if by_name and any(v == "skipped" and r.startswith("not installed") for v, r in pairs):
        raise typer.Exit(NOT_INSTALLED)
    if any(v in ("fail", "error") for v, _ in pairs):
        raise typer.Exit(LIMIT_BROKEN)


def _request(
    names: list[str],
    tag: str,
    engines: list[str],
    profiles: list[str],
    metrics: list[str],
    dt: str | None,
    out: Path | None,
) -> Request:
    """The request behind the arguments; a wrong one ends the program with a line."""
    from adapters.registry import ENGINES
    from reports.metrics import METRICS
    from reports.run import DEFAULT_PROFILES, Request, columns_of

    scenarios = _scenarios(names, tag)
    engines = [_known("engine", name, ENGINES) for name in dict.fromkeys(engines)] or list(ENGINES)
    every = dict.fromkeys(profile for entry in ENGINES.values() for profile in entry.profiles)
    profiles = [_known("profile", name, every) for name in dict.fromkeys(profiles)]
    spreads = [f"{name}.spread" for name in METRICS if name.startswith("events.")]
    for name in metrics:
        _known("metric", name, [*METRICS, *spreads, "ratio.time"])
    columns = columns_of(engines, profiles or DEFAULT_PROFILES)
    if not columns:
        _stop(f"no engine of {', '.join(engines)} has the profile {', '.join(profiles)}", BAD_INPUT)
    step = _step(dt, scenarios) if dt is not None else None
    command = " ".join(["touchstone", *sys.argv[1:]])
    return Request(tuple(scenarios), columns, out or _folder_of_now(), step, tuple(metrics), command)


def _scenarios(names: list[str], tag: str) -> list[Scenario]:
    from scenarios.catalogue import catalogue, tagged, tags
    from scenarios.scenario import ScenarioError

    try:
        if names:
            return [catalogue()[_known("scenario", name, catalogue())] for name in dict.fromkeys(names)]
        return list(tagged(_known("tag", tag, tags())))
    except ScenarioError as error:
        _stop(str(error), BAD_INPUT)


def _step(text: str, scenarios: Iterable[Scenario]) -> float:
    """A step such as 1/240; it must divide the frame of every scene."""
    from fractions import Fraction

    from adapters.record import substeps

    try:
        value = float(Fraction(text))
        for scenario in scenarios:
            substeps(scenario, value)
    except (ValueError, ZeroDivisionError, OverflowError) as error:
        _stop(f"--dt {text}: {error}", BAD_INPUT)
    return value


def _progress(total: int, quiet: bool):  # type: ignore[no-untyped-def]
    from reports.progress import bar, lines, silence

    if quiet:
        return silence()
    return bar(total) if sys.stderr.isatty() else lines(total)


study = typer.Typer(help="Studies beside the scenes.", no_args_is_help=True)
app.add_typer(study, name="study")


@study.command("narrow-phase")
def narrow_phase(
    pairs: Annotated[int, typer.Option(help="Pairs of convex pieces, over all families.")] = 1000,
    seed: Annotated[int, typer.Option(min=0, help="Of the random poses.")] = 0,
    out: Annotated[Path | None, typer.Option(help="Folder (default: runs/narrow-phase-<time>).")] = None,
    output: FormatOption = Format.table,
    quiet: Annotated[bool, typer.Option("--quiet", help="No progress and no table.")] = False,
) -> None:
    """Send the same poses through every detector; compare with the explicit Minkowski difference."""
    from reports.output import OutputError
    from reports.studies.narrow_phase import PairsError, run, steps

    folder = out or _folder_of_now("narrow-phase-")
    try:
        with _progress(steps(pairs), quiet) as progress:
            frame = run(pairs, seed, folder, progress)
    except (PairsError, OutputError) as error:
        _stop(str(error), BAD_INPUT)
    if _printed(frame, output) or quiet:
        return _exit_for(frame.verdict, frame.reason, by_name=False)
    from reports.studies.narrow_phase_table import show as show_study
    from reports.terminal import console

    show_study(frame, console())
    print(f"results: {folder}")
    _exit_for(frame.verdict, frame.reason, by_name=False)


@app.command("list")
def list_things(what: Listing, output: FormatOption = Format.table) -> None:
    """List scenarios, engines, metrics or profiles."""
    from adapters.registry import ENGINES
    from reports.listing import show_rows

    rows: list[dict[str, object]]
    if what is Listing.scenarios:
        from scenarios.catalogue import catalogue

        rows = [
            {"scenario": s.name, "tags": " ".join(s.tags), "duration [s]": s.duration, "summary": s.summary}
            for s in catalogue().values()
        ]
    elif what is Listing.engines:
        from reports.doctor import engines

        rows = [{"engine": name, "version": found, "missing": how} for name, found, how in engines()]
    elif what is Listing.metrics:
        from reports.metrics import METRICS

        rows = [
            {"metric": m.name, "unit": m.unit, "better": m.better, "definition": m.formula}
            for m in METRICS.values()
        ]
    else:
        from reports.run import step_text

        rows = [
            {"profile": profile, "engine": name, "step [s]": step_text(dt)}
            for name, entry in ENGINES.items()
            for profile, dt in entry.profiles.items()
        ]
    show_rows(rows, output)


@app.command()
def show(scenario: str, output: FormatOption = Format.table) -> None:
    """Show what a scenario is made of."""
    from adapters.record import scenario_json
    from reports.listing import show_rows

    chosen = _scenarios([scenario], "")[0]
    if output is Format.json:
        print(scenario_json(chosen))
        return
    rows: list[dict[str, object]] = [
        {
            "body": body.name,
            "kind": body.kind,
            "material": body.material,
            "mass [kg]": f"{body.mass:.4g}" if body.kind != "fixed" else "",
            "pieces": len(body.pieces),
        }
        for body in chosen.bodies
    ]
    if output is Format.table:
        print(f"{chosen.name}: {chosen.summary}")
        effects = ", ".join(chosen.effects)
        print(f"{chosen.duration:g} s at {chosen.frame_rate} frames per second, effects {effects}")
        for e in chosen.expectations:
            print(f"expects {e.event} {e.body}-{e.other} from {e.earliest:g} to {e.latest:g} s")
    show_rows(rows, output)


@app.command()
def doctor() -> None:
    """Engines, versions, missing wheels, processor and the compile cache."""
    from reports.doctor import compile_facts, engines, libraries, machine

    for key, value in machine().items():
        print(f"{key:14} {value}")
    for name, found, how in engines():
        print(f"{name:14} {how or found}")
    for name, found in libraries():
        print(f"{name:14} {found}")
    print("compiling the reference, once per version of its sources ...", file=sys.stderr)
    for key, value in compile_facts().items():
        print(f"{key:14} {value}")
