from __future__ import annotations

import shutil
import sys
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from touchstone.reports.cli import options

if TYPE_CHECKING:
    from touchstone.reports.nightly.night import NightResults
    from touchstone.reports.nightly.store import Night, Store
    from touchstone.reports.nightly.verdict import Finding


StoreOption = Annotated[str, typer.Option(help="Folder of nights, or a URL that fsspec knows.")]


def nightly(
    store: StoreOption = "nights",
    quick: Annotated[bool, typer.Option("--quick", help="The gallery and a few probes.")] = False,
    quiet: options.QuietOption = False,
) -> None:
    """Measure all scenes, store the night, and compare it with the accepted night and with those before."""
    from touchstone.adapters.registry import ENGINES
    from touchstone.reports.nightly.night import QUICK_PROFILES, measure, scenes, working_folder
    from touchstone.reports.nightly.store import Store, StoreError
    from touchstone.reports.runner.request import DEFAULT_PROFILES, columns_of, limited
    from touchstone.scenarios.plural import plural

    columns = columns_of(ENGINES, QUICK_PROFILES if quick else DEFAULT_PROFILES)
    settings = {"quick": quick, "columns": ["/".join(column) for column in columns]}
    options.require_judge()
    try:
        with Store(store).opened() as opened, working_folder(settings) as work:
            chosen = scenes(quick)
            frames = sum(s.frame_count for s in chosen) * len(columns)
            with options.progress_for(frames, quiet, by_scene=True) as progress:
                told = limited(progress, frames, inf, "frames; hard cases and studies follow")
                measured = measure(chosen, columns, work, told, opened.nights())
            before = opened.nights()
            night = opened.add(measured.frame, measured.identity)
            shutil.rmtree(work[0], ignore_errors=True)
            findings, sentence, page = _publish(opened, [*before, night], night, measured)
    except KeyboardInterrupt:
        raise options.Interrupted("finished scenes are kept, the same command goes on") from None
    except StoreError as error:
        options.stop(str(error))
    except OSError as error:
        options.stop(f"{store}: {error.strerror or error}; finished scenes are kept, run again")
    if measured.continued and not quiet:
        print(f"continued a night: {plural(measured.continued, 'scene')} measured before", file=sys.stderr)
    lines = [one.line for one in findings if one.kind in ("regression", "warning")]
    for line in [*lines, *opened.notes, *measured.faults]:
        print(line, file=sys.stderr)
    options.tell_failures(measured.frame)
    if not quiet:
        print(sentence)
        print(f"page: {page}")
    if any(one.kind == "regression" for one in findings):
        raise typer.Exit(options.LIMIT_BROKEN)
    if measured.faults:
        raise typer.Exit(options.INTERNAL_ERROR)
    options.exit_for(measured.frame.verdict, by_name=False)


def _publish(
    store: Store, nights: list[Night], night: Night, measured: NightResults
) -> tuple[list[Finding], str, Path]:
    """Compare the night, and write its pages; what was measured is stored already. Returns the findings, the
    verdict in one sentence, and the page."""
    from touchstone.reports.nightly import verdict

    known_nights = {one.sequence: one for one in nights}
    fingerprint = str(night.identity["fingerprint"])
    before = [one for one in nights if one is not night]
    new_hardware = all(one.identity.get("fingerprint") != fingerprint for one in before)
    baseline = _baseline(store, before, night)
    findings, kept = [], None
    if baseline is not None:
        kept = verdict.compared_with(store, before, baseline, measured.frame)
        findings += verdict.physics(measured.frame, kept)
    history = verdict.histories(store, nights, fingerprint)
    record = store.accepted()
    findings += verdict.timing(history, known_nights, int(record["sequence"]) if record else 0)
    level, sentence = verdict.sentence(measured.frame, findings, kept, new_hardware)
    folder = store.folder / "pages" / night.run
    folder.mkdir(parents=True, exist_ok=True)
    writers = {
        "junit.xml": lambda: verdict.write_junit(folder, measured.frame, findings),
        "badge.json": lambda: verdict.write_badge(folder, level),
        "report.html": lambda: verdict.write_page(
            *(folder, measured, level, sentence, findings),
            (verdict.history_charts(history, known_nights), verdict.history_table(history, known_nights)),
        ),
        "report.md": lambda: verdict.write_markdown(
            folder, verdict.markdown(sentence, findings, [*store.notes, *measured.faults])
        ),
    }
    for name, write in writers.items():
        try:
            write()
            store.push(folder / name)
        except Exception as error:
            reason = f"{type(error).__name__}: {error}".splitlines()[0]
            measured.faults.append(f"{name} could not be written; the night is stored: {reason}")
    return verdict.ordered(findings), sentence, folder / "report.html"


def _baseline(store: Store, before: list[Night], night: Night) -> Night | None:
    """The night whose physics tonight's is compared with: the accepted one; or else, of these settings, the
    first on this hardware, or the last on any."""
    record = store.accepted()
    for one in before:
        if record and one.run == record["run"]:
            return one
    same = [one for one in before if one.identity.get("settings") == night.identity["settings"]]
    here = [one for one in same if one.identity.get("fingerprint") == night.identity["fingerprint"]]
    return next(iter([*here, *reversed(same)]), None)


def accept(
    run: Annotated[str, typer.Argument(help="Name of a night (its page's folder), or `last`.")],
    reason: Annotated[str, typer.Option(help="Why its figures are right.")],
    store: StoreOption = "nights",
) -> None:
    """Compare later nights with this one: its figures and its times are accepted."""
    from touchstone.reports.nightly.store import MARK, Store, StoreError

    if not reason.strip():
        options.stop("--reason: say why the figures of this night are right")
    if "://" not in store and not (Path(store) / MARK).exists():
        options.stop(f"--store {store}: no store of nights here")
    with options.refusing(StoreError), Store(store).opened() as opened:
        nights = {night.run: night for night in opened.nights()}
        if not nights:
            options.stop(f"--store {store}: holds no night yet")
        name = list(nights)[-1] if run == "last" else options.known("night", run, ("last", *nights))
        opened.accept(nights[name], reason)
    print(f"accepted {name}: {reason}")
