"""`touchstone nightly`: continues what was killed, stores once, and reports what changed."""

import errno
import json
import os
import shutil
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from forged_tables import JSONS, WAYS, forge

from touchstone.adapters.registry import DEFAULT_ENGINES
from touchstone.adapters.workers.children import Children
from touchstone.adapters.workers.scratch import locked
from touchstone.reports.cli import nightly as nightly
from touchstone.reports.nightly import night as module
from touchstone.reports.nightly import store as identity
from touchstone.reports.nightly import verdict
from touchstone.reports.nightly.night import HARD, OUTCOME, Study, due, rows_for_nights, studies
from touchstone.reports.nightly.store import KEY, Night, Store
from touchstone.reports.nightly.verdict import GONE, REGRESSION, compared_with, physics
from touchstone.reports.results import Row, rows_of, table
from touchstone.scenarios.catalogue import catalogue


def _study(name, period=7, seconds=10.0):
    return Study(name, period, seconds, lambda out, scratch, progress: table([]))


def _nights(*held, fingerprint="one"):
    return [
        Night(Path(), {"run": f"{k}", "sequence": k, "fingerprint": fingerprint, "studies": studies})
        for k, studies in enumerate(held, start=1)
    ]


def _names(*arguments, **options):
    return [study.name for study in due(*arguments, **options)]


def test_periods_are_counted_in_nights_of_one_machine():
    """A study is due when its period is over; nights of other machines do not count."""
    every = [_study("a", 3)]
    assert _names(every, [], "one") == ["a"]
    nights = _nights({"a": 9.0}, {}, {})
    assert _names(every, nights[:2], "one") == []
    assert _names(every, nights, "one") == ["a"]
    assert _names(every, nights, "two") == ["a"]
    assert _names(every, _nights({"a": 9.0}, None, 3, fingerprint="one"), "one") == ["a"]


def test_hard_cases_come_first_and_the_longest_overdue_next():
    """Of many that are due a night takes two beside the hard cases."""
    every = [_study("a", 2), _study("b", 2), _study("c", 8), _study(HARD, 1)]
    nights = _nights({"a": 1.0}, {"b": 1.0}, *[{}] * 8, {HARD: 1.0})
    assert _names(every, nights, "one") == [HARD, "c", "a"]


def test_a_study_must_fit_into_the_time_that_is_left():
    """By what it took the last time here; before that, by its entry."""
    every = [_study("a", 1, seconds=10.0), _study("b", 1, seconds=50.0)]
    assert _names(every, [], "one", left=30.0) == ["a"]
    assert _names(every, _nights({"a": 40.0, "b": 5.0}), "one", left=30.0) == ["b"]
    assert _names(every, [], "one", left=-1.0) == []


def test_all_families_have_their_turn():
    """Hard cases rotate; a quick night has fewer."""
    assert studies(0, quick=True)[0].seconds < studies(0, quick=False)[0].seconds
    assert {study.name for study in studies(3, quick=False)} >= {HARD, "calibration", "relations"}


def _hard(name):
    return Row(HARD, "hard_mass_1e6", "mujoco", "recommended", 1 / 540, OUTCOME, 1e6, subject=name)


def test_rows_are_kept_without_times_and_with_their_step():
    """Times are left out, several steps become part of the subject, classes become numbers."""
    base = ("agreement", "fall", "mujoco", "recommended")
    rows = [
        Row(*base, 1 / 60, "agreement.error", 1e-3, "m"),
        Row(*base, 1 / 240, "agreement.error", 1e-4, "m"),
        Row(*base, 1 / 240, "time.frame", 1e-4, "s"),
        _hard("ok"),
        Row(HARD, "mass", "mujoco", "recommended", 1 / 540, "stability.survived", 3.0, subject="jitter"),
    ]
    kept = rows_for_nights(table(rows))
    assert kept.subject.tolist() == ["at 1/60 s", "at 1/240 s", ""]
    assert kept.verdict.tolist() == ["", "", "pass"]
    assert kept.reason.iloc[-1] == "ok"


@pytest.mark.parametrize(
    ("before", "after", "kind"), [("ok", "exploded", REGRESSION), ("jitter", "ok", GONE), ("ok", "ok", None)]
)
def test_an_outcome_that_changes_is_a_finding(before, after, kind):
    """A hard case that is no longer survived is a regression, named by its classes."""
    found = physics(rows_for_nights(table([_hard(after)])), rows_for_nights(table([_hard(before)])))
    assert [(one.kind, one.moved) for one in found] == ([(kind, f"{before} -> {after}")] if kind else [])


@pytest.mark.parametrize(("accepted", "said"), [(0, "ok"), (2, "jitter"), (3, "jitter")])
def test_what_the_accepted_night_lacks_is_compared_with_one_that_had_it(store, nights, accepted, said):
    """With the last night before it, else with the first after it: a change stays a finding until it is
    accepted."""
    study, other = (rows_for_nights(table([_hard(name)])) for name in ("ok", "jitter"))
    for number, frame in enumerate((nights.frame(), study, other, nights.frame())):
        store.add(frame, nights.facts(number))
    found = store.nights()
    assert set(compared_with(store, found, found[accepted], nights.frame()).scenario) == {"fall"}
    assert compared_with(store, found, found[accepted], study).reason.tolist() == [said]


@pytest.fixture
def program(monkeypatch, tmp_path, nights, touchstone):
    """Call the program with two scenes that cost nothing: (exit code, stdout, stderr, what was played)."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    chosen = (catalogue()["fall"], catalogue()["slip"])
    monkeypatch.setattr(module, "scenes", lambda quick: chosen)
    monkeypatch.setattr(module, "studies", lambda turn, quick: [Study("robustness", 2, 1.0, study)])
    played = []

    def study(out, scratch, progress):
        played.append("study")
        if state.get("study") == "fails":
            raise ValueError("no\nscenes")
        found = nights.frame(scene="random", **state.get("frame", {}))
        return found.assign(study="robustness")

    def measure_scene(request, scenario, folder, children, results, progress):
        played.append(scenario.name)
        if state.get("dies") == scenario.name:
            raise KeyboardInterrupt
        return rows_of(nights.frame(scene=scenario.name, **state.get("frame", {})))

    monkeypatch.setattr(module, "measure_scene", measure_scene)
    state = {}

    def call(*arguments, **changes):
        state.clear()
        state.update(changes)
        played.clear()
        return (*touchstone(*arguments), list(played))

    return call


def test_a_killed_night_is_continued(program, tmp_path):
    """Scenes that were finished are not measured again; the night is stored once, the work folder is gone."""
    code, _, err, played = program("nightly --quick", dies="slip")
    assert (code, played) == (130, ["fall", "slip"])
    code, out, err, played = program("nightly --quick")
    assert (code, played) == (0, ["slip", "study"])
    assert "continued a night: 1 scene measured before" in err
    assert "First night of these settings" in out
    assert len(Store("nights").nights()) == 1
    assert list((tmp_path / "cache").glob("touchstone/nightly/unfinished/*")) == []


def test_two_nights_at_once_measure_for_themselves(program, tmp_path):
    """A night with another store leaves the folder of one that is alive, and stores a night of its own."""
    assert program("nightly --quick", dies="slip")[0] == 130
    folders = list((tmp_path / "cache").glob("touchstone/nightly/unfinished/*"))
    lock = locked(folders[0])
    code, _, err, played = program("nightly --quick --store other")
    os.close(lock)
    assert (code, played, "continued" in err) == (0, ["fall", "slip", "study"], False)
    assert list((tmp_path / "cache").glob("touchstone/nightly/unfinished/*")) == folders
    assert program("nightly --quick")[3] == ["slip", "study"]
    runs = [Store(name).nights()[0].run for name in ("nights", "other")]
    assert len(set(runs)) == 2


def test_a_regression_is_exit_1_until_it_is_accepted(program, tmp_path):
    """A limit that breaks after a good night: exit 1 with its place; `accept` moves what is compared with."""
    assert program("nightly --quick")[0] == 0
    place = "regression: fall mujoco recommended: deepest overlap (overlap.max)"
    worse = {"overlap": 1.6e-3, "verdict": "known"}
    code, _, err, _ = program("nightly --quick", frame={"overlap": 1.5e-3, "verdict": "known"})
    assert code == 1
    assert f"{place}: 1.00 -> 1.50 mm: a known failing began" in err
    assert "did you mean 'last'?" in program("accept lasst --reason understood")[2]
    assert program("accept last --reason understood")[0] == 0
    code, out, err, _ = program("nightly --quick", frame=worse)
    assert code == 1
    assert f"{place}: 1.50 -> 1.60 mm: a known failing grew" in err
    # the accepted night had no study: it is compared with the night before
    assert "3 confirmed regressions (mujoco)" in out
    last = Store("nights").nights()[-1]
    page = tmp_path / "nights" / "pages" / last.run
    names = sorted(path.name for path in page.iterdir())
    assert names == ["badge.json", "junit.xml", "report.html", "report.md"]
    html = (page / "report.html").read_text("utf-8")
    assert "a known failing grew" in html
    assert "Against published values" in html
    assert json.loads((page / "badge.json").read_text())["message"] == "regression"
    code, out, *_ = program("accept", last.run, "--reason", "a trade")
    assert (code, out) == (0, f"accepted {last.run}: a trade\n")
    assert program("nightly --quick", frame=worse)[0] == 0


def test_physics_is_compared_across_hardware(program, monkeypatch):
    """Compare a new processor's physics with the last night, then its own; an accepted night holds on all."""

    def on(hardware):
        changed = lambda settings: identity.identity(settings) | {"fingerprint": hardware}  # noqa: E731
        monkeypatch.setattr(module, "identity", changed)

    deep = {"overlap": 3e-3, "verdict": "fail"}
    on("one")
    assert program("nightly --quick")[0] == 0
    on("two")
    code, out, err, _ = program("nightly --quick", frame={"time": 1.0, **deep})
    assert (code, "time.frame" in err) == (1, False)
    grown = "mujoco recommended: deepest overlap (overlap.max): 1.00 -> 3.00 mm: pass -> fail"
    assert f"regression: slip {grown}" in err
    assert f"regression: random {grown}" in err
    assert "fail: slip mujoco recommended: overlap.max 0.003, limit 0.002: a reason" in err
    assert "First night on this hardware: its times have nothing to compare with." in out
    _, out, err, _ = program("nightly --quick", frame=deep)
    assert ("First night" in out, "regression:" in err) == (False, False)
    first = Store("nights").nights()[0].run
    assert program("accept", first, "--reason", "right")[0] == 0
    assert "regression: fall mujoco" in program("nightly --quick", frame=deep)[2]


def test_what_is_missing_is_told_before_the_night(program, without_coal):
    """Without a judge nothing is played: exit 4 and one line."""
    code, out, err, played = program("nightly --quick")
    assert (code, out, err.count("\n"), played) == (4, "", 1, [])
    assert "cannot be judged" in err


def test_a_night_that_nobody_reads_is_stored(program, monkeypatch):
    """A closed standard output is exit 141 without a word about the store; the night is there."""

    def closed(*arguments, file=None, **options):
        if file is None:
            raise BrokenPipeError(errno.EPIPE, "Broken pipe")

    monkeypatch.setattr(nightly, "print", closed, raising=False)
    code, _, err, _ = program("nightly --quick")
    assert (code, "run again" in err) == (141, False)
    assert len(Store("nights").nights()) == 1


@pytest.mark.parametrize("command", ["nightly", "nightly --quick"])
def test_every_engine_plays(program, monkeypatch, command):
    """A night asks for all engines, quick or not."""
    asked = []
    original = module.measure_scene

    def measure_scene(request, *others):
        asked.append(request.columns)
        return original(request, *others)

    monkeypatch.setattr(module, "measure_scene", measure_scene)
    assert program(command)[0] == 0
    assert all({engine for engine, _ in columns} >= set(DEFAULT_ENGINES) for columns in asked)
    assert len(asked) == 2


def test_a_store_that_cannot_be_made_is_refused(program, tmp_path):
    """One line with the reason, before anything is played."""
    (tmp_path / "file").touch()
    code, _, err, played = program("nightly --quick --store file")
    assert (code, err, played) == (2, "touchstone: file: Not a directory\n", [])


def test_children_end_before_their_folder_is_removed(program, monkeypatch):
    """After Ctrl-C too: a child that starts meanwhile writes its output there."""
    folders, kept, original = [], [], module.measure_scene

    class Ending(Children):
        def __exit__(self, *error):
            kept.append(folders[0].is_dir())
            super().__exit__(*error)

    def measure_scene(request, scenario, folder, *others):
        folders.append(request.out)
        return original(request, scenario, folder, *others)

    monkeypatch.setattr(module, "Children", Ending)
    monkeypatch.setattr(module, "measure_scene", measure_scene)
    assert program("nightly --quick", dies="fall")[0] == 130
    assert kept == [True]


def test_a_study_is_announced_as_one(program):
    """Progress names a study as a study, on a line of its own."""
    assert program("nightly --quick")[2].splitlines() == [
        "scene 1 of 2: fall",
        "scene 2 of 2: slip",
        "study robustness",
    ]


def test_a_study_is_measured_when_it_is_due(program):
    """Every second night; it is compared with the night that had it last; one that fails is due again."""
    assert program("nightly --quick")[3] == ["fall", "slip", "study"]
    assert program("nightly --quick")[3] == ["fall", "slip"]
    code, _, err, played = program("nightly --quick", study="fails")
    assert (code, played) == (70, ["fall", "slip", "study"])
    assert "study robustness failed: ValueError: no\n" in err
    code, _, err, played = program("nightly --quick", frame={"overlap": 3e-3, "verdict": "fail"})
    assert (code, played) == (1, ["fall", "slip", "study"])
    assert "random mujoco recommended: deepest overlap (overlap.max): 1.00 -> 3.00 mm: pass -> fail" in err


def test_a_page_that_fails_leaves_the_night(program, monkeypatch):
    """Where the page cannot be written the night is stored, and the exit code says so."""

    def fails(*arguments):
        raise KeyError("cell")

    monkeypatch.setattr(verdict, "write_page", fails)
    code, _, err, _ = program("nightly --quick --quiet")
    assert code == 70
    assert "report.html could not be written; the night is stored: KeyError: 'cell'" in err
    assert len(Store("nights").nights()) == 1


@pytest.mark.parametrize(
    ("command", "said"),
    [
        ("accept last --reason x", "--store nights: no store of nights here"),
        ("accept last --reason ' '", "--reason: say why"),
        ("nightly --store nowhere://x", "nowhere://x: "),
    ],
)
def test_wrong_input_is_one_line(program, command, said):
    """Exit 2 and one line; nothing is measured."""
    if "nowhere" in said:
        pytest.importorskip("fsspec")
    code, out, err, played = program(command)
    assert (code, out, err.count("\n"), played) == (2, "", 1, [])
    assert said in err


def survives(program, *arguments):
    """Play a night; it is stored with every page, and nothing but lines on files is printed. Returns them."""
    code, _, err, _ = program("nightly --quick", *arguments)
    assert code in (0, 1), err
    assert "Traceback" not in err
    assert "could not be written" not in err
    return err


@pytest.fixture(scope="module")
def two_nights(tmp_path_factory):
    """Folder for a copy of the store below."""
    return tmp_path_factory.mktemp("nights") / "two"


@pytest.fixture
def stored(program, two_nights, tmp_path):
    """A store of two nights, the first one accepted; returns the program."""
    if two_nights.exists():
        shutil.copytree(two_nights, tmp_path, dirs_exist_ok=True)
        return program
    assert program("nightly --quick")[0] == 0
    assert program("accept last --reason good")[0] == 0
    assert program("nightly --quick")[0] == 0
    shutil.copytree(tmp_path, two_nights)
    return program


@pytest.mark.parametrize("ways", list(zip(WAYS[::4], WAYS[2::4])))
def test_a_forged_night_is_set_aside_or_read(stored, tmp_path, ways):
    """Whatever the files of two nights hold, the next night is compared, stored and shown."""
    for path, way in zip(sorted((tmp_path / "nights" / "runs").iterdir()), ways, strict=True):
        forge(path, way)
    survives(stored)
    assert stored("accept last --reason good")[0] == 0


@pytest.mark.slow
@pytest.mark.parametrize("text", JSONS.values(), ids=JSONS)
def test_forged_documents_of_a_store_are_set_aside(stored, tmp_path, text):
    """So it is with the identity of a night, an acceptance, and what a killed night left."""
    for path in sorted((tmp_path / "nights" / "runs").iterdir()):
        table = pq.read_table(path)
        pq.write_table(table.replace_schema_metadata({KEY: text.encode()}), path)
    (tmp_path / "nights" / "accepted" / "000001.json").write_text(text)
    assert stored("nightly --quick", dies="slip")[0] == 130
    for path in (tmp_path / "cache").glob("touchstone/nightly/unfinished/*/fall.json"):
        path.write_text(text)
    survives(stored)
    assert stored("accept last --reason good")[0] == 0
    for path in (tmp_path / "cache").glob("touchstone/nightly/unfinished/*/*.json"):
        path.write_text(text)
    survives(stored)
    (tmp_path / "nights" / "touchstone-store.json").write_text(text)
    code, _, err, _ = stored("nightly --quick")
    assert (code, err.count("\n")) == (2, 1) or '"format": 1' in text


def test_an_acceptance_that_is_set_aside_replaces_no_other(stored, tmp_path):
    """The number of a new acceptance follows from the last one."""
    assert stored("accept last --reason two")[0] == 0
    accepted = tmp_path / "nights" / "accepted"
    (accepted / "000001.json").write_text("[]")
    assert stored("accept last --reason three")[0] == 0
    reasons = [json.loads(path.read_text())["reason"] for path in sorted(accepted.iterdir())]
    assert reasons == ["two", "three"]


def test_a_store_may_have_any_name(program):
    """Quotes, brackets and patterns in the name of a store are letters."""
    name = '-it\'s ö "b" [ab]*'
    for _ in range(3):
        survives(program, f"--store={name}")
    assert len(Store(name).nights()) == 3
