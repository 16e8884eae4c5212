"""`touchstone env`: environments of engines whose requirements conflict with those of this program."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from time import perf_counter
from typing import TYPE_CHECKING, Annotated

import typer

from touchstone.reports.cli import options

if TYPE_CHECKING:
    from touchstone.adapters.workers.own_environment import OwnEnvironment

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
    """Environment of an engine; an unknown name exits with one line."""
    found = {one.engine: one for one in environments()}
    return found[options.known("environment", name, found)]
