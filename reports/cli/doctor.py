"""`touchstone check-engine`, `touchstone doctor`, and `touchstone env`: engines in environments of their own.

The module is imported by every command: what it needs of engines is imported on demand.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable
from time import perf_counter
from typing import TYPE_CHECKING, Annotated

import typer

from touchstone.reports.cli import options

if TYPE_CHECKING:
    from touchstone.adapters.workers.own_environment import OwnEnvironment


def check_engine(
    name: Annotated[str, typer.Argument(help="An engine, or module:Class of one that is not installed.")],
    profile: Annotated[str, typer.Option(help="Profile (default: the first of the engine).")] = "",
    out: options.PrintedOutOption = None,
    output: options.FormatOption = options.Format.table,
    quiet: options.QuietOption = False,
) -> None:
    """Play small scenes with known outcomes on an engine; say what its adapter does wrong."""
    from touchstone.reports.docs.listing import show_rows

    engine = options.engine_installed(name)
    rows: list[dict[str, object]] = []
    at_once = output is options.Format.table and not quiet
    with options.output_to(out):
        _check(engine, profile, rows, at_once)
        if output is not options.Format.table:
            show_rows(rows, output)
    faults = [row for row in rows if row["verdict"] == "fault"]
    for row in faults if quiet else ():
        print(f"fault: {row['check']}: {row['finding']}", file=sys.stderr)
    if faults:
        raise typer.Exit(options.LIMIT_BROKEN)


def _check(engine: str, profile: str, rows: list[dict[str, object]], at_once: bool) -> None:
    """Append the findings of all checks to `rows`, and print each as soon as it is known."""
    from touchstone.adapters.conformance.check import check
    from touchstone.adapters.contract import AdapterError

    with options.refusing(AdapterError):
        for report in check(engine, profile):
            lines = [("fault", fault) for fault in report.faults]
            lines += [("not checked", report.skipped)] if report.skipped else []
            for verdict, text in lines or [("ok", "")]:
                rows.append({"check": report.check, "verdict": verdict, "finding": text})
                if at_once:
                    print(f"{verdict:12}{report.check:16}{text}".rstrip(), flush=True)


LIBRARIES = ("numpy", "scipy", "pandas", "numba", "python-fcl", "coal", "pin")


def imports() -> list[tuple[str, str, str]]:
    """(engine, status, message) of every engine and then of every oracle, imported in a child process each;
    the message is the version if the import succeeded."""
    from touchstone.adapters.registry import available
    from touchstone.adapters.workers.import_check import try_imports
    from touchstone.reports.metrics.context import judge_faults
    from touchstone.reports.results import UNJUDGED

    rows = [(name, one.status, one.text) for name, one in try_imports(available()).items()]
    faults = judge_faults()
    return [*rows, *(("judge", UNJUDGED, fault) for fault in faults)]


def environment_rows() -> list[tuple[str, str, str]]:
    """(name, text, status) of the environments that were added; the status of a broken one is its state."""
    rows = [row_of(one) for one in environments() if one.folder.exists()]
    return [
        (
            f"{row['engine']} folder",
            f"{row['state']}, {row['size [MB]']} MB, {row['folder']}",
            "" if row["state"] == "ok" else "broken",
        )
        for row in rows
    ]


def libraries() -> list[tuple[str, str]]:
    """(library, version) of the libraries on which results depend."""
    from touchstone.reports.machine import package_version

    return [(name, package_version(name, "not installed")) for name in LIBRARIES]


def compile_facts() -> dict[str, str]:
    """Location of the compiled kernels and their compile time; compiles them if not yet done."""
    from touchstone.adapters.engines.reference.compiling import compile_seconds
    from touchstone.reference_impl.core.kernel_cache import CACHE_FOLDER, REJECTED, UNWRITTEN, damaged_count

    notes = [f"not used: {one}" for one in REJECTED]
    if CACHE_FOLDER and (count := damaged_count(CACHE_FOLDER)):
        notes.append(f"damaged files removed: {count}, the next run compiles their kernels again")
    seconds = compile_seconds()
    if UNWRITTEN:
        notes.append(f"{len(UNWRITTEN)} kernels could not be written, they compile in every process")
    place = str(CACHE_FOLDER or "none, kernels compile in every process")
    return {
        "kernel cache": "; ".join((place, *notes)),
        "compile time": f"{seconds:.1f} s cold, once per version of the sources",
    }


def doctor(
    out: options.PrintedOutOption = None,
    output: options.FormatOption = options.Format.table,
    quiet: options.QuietOption = False,
) -> None:
    """Engines, imported in a child process each, judges, versions, processor and the compile cache."""
    from touchstone.adapters.engines.reference.compile_progress import announcement
    from touchstone.reports.docs.listing import show_rows
    from touchstone.reports.machine import machine

    found = [(str(key), str(value), "") for key, value in machine().items()]
    tried = imports()
    found += [(name, text if end == "done" else f"{end}: {text}", end) for name, end, text in tried]
    found += environment_rows()
    found += [(name, text, "") for name, text in libraries()]
    if note := announcement():
        print(note, file=sys.stderr)
    found += [(key, value, "") for key, value in compile_facts().items()]
    with options.output_to(out):
        if output is options.Format.table and quiet:
            for name, text, status in found:
                if status not in ("", "done"):
                    print(f"{name}: {text}", file=sys.stderr)
        elif output is options.Format.table:
            for name, text, _ in found:
                print(f"{name:14} {text}")
        else:
            show_rows([dict(zip(("name", "value", "status"), row)) for row in found], output)
    options.exit_for((status for _, status, _ in tried), by_name=False)


env = typer.Typer(no_args_is_help=True, help="Environments of engines whose requirements conflict with ours.")
MEGABYTE = 1e6
Engine = Annotated[str, typer.Argument(help="Engine (touchstone env list).")]


@env.command()
def add(name: Engine) -> None:
    """Install an engine into an environment of its own, unless it is there and whole."""
    added([_named(name)])


@env.command("list")
def list_environments(
    out: options.PrintedOutOption = None, output: options.FormatOption = options.Format.table
) -> None:
    """List environments: whether they are added and whole, their sizes and folders."""
    from touchstone.reports.docs.listing import show_rows

    with options.output_to(out):
        show_rows([row_of(one) for one in environments()], output)


@env.command()
def remove(name: Engine) -> None:
    """Remove an engine's environment, and those of earlier versions of this program."""
    from touchstone.adapters.workers.own_environment import OwnEnvironmentError

    try:
        gone = _named(name).remove()
    except OwnEnvironmentError as error:
        options.stop(str(error), options.ENGINE_MISSING)
    print("\n".join(f"removed: {place}" for place in gone) or f"{name}: no environment")


def environments() -> list[OwnEnvironment]:
    """Environments of all engines that need one of their own."""
    from touchstone.adapters.registry import available, own_environment

    return [one for one in map(own_environment, available()) if one is not None]


def row_of(one: OwnEnvironment) -> dict[str, object]:
    """Row of an environment: engine, state, size and folder."""
    there = one.folder.exists()
    fault = one.fault() if there else ""
    state = f"broken: {fault}" if fault else "ok" if there else "not added"
    size = f"{one.size() / MEGABYTE:.0f}" if there else ""
    return {"engine": one.engine, "state": state, "size [MB]": size, "folder": str(one.folder)}


def added(wanted: Iterable[OwnEnvironment]) -> None:
    """Add environments that are missing or broken; one that cannot be had exits with one line."""
    from touchstone.adapters.workers.own_environment import OwnEnvironmentError

    for one in wanted:
        try:
            if one.folder.exists():
                if not one.fault():
                    print(f"{one.engine}: {one.folder}")
                    continue
                one.remove()
            print(f"{one.engine}: installing {len(one.pins)} packages", file=sys.stderr)
            start = perf_counter()
            one.add()
        except OwnEnvironmentError as error:
            options.stop(str(error), options.ENGINE_MISSING)
        seconds, size = perf_counter() - start, one.size() / MEGABYTE
        print(f"{one.engine}: {one.folder}, {size:.0f} MB, added in {seconds:.0f} s")


def install(engines: Iterable[str]) -> None:
    """Add the environments that named engines need (`--install`)."""
    from touchstone.adapters.registry import own_environment

    added(one for one in map(own_environment, options.engines_named(engines)) if one is not None)


def _named(name: str) -> OwnEnvironment:
    found = {one.engine: one for one in environments()}
    return found[options.known("environment", name, found)]
