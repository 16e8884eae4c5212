"""The study stability: what is played, what a column survives, and whose envelope contains whose."""

import pytest
from scripted_engines import Engine

from touchstone.adapters.contract import Settings
from touchstone.reports.results import CONSTRUCTION, table
from touchstone.reports.runner.tasks import own_step
from touchstone.reports.studies.stability.play import (
    STEPS,
    Played,
    Scope,
    chosen,
    hard_cell,
    line_of,
    play_all,
    play_scenario,
)
from touchstone.reports.studies.stability.study import (
    CONTAINED,
    LEVELS,
    LOOKS,
    OUTCOME,
    STEP,
    Envelope,
    drawn,
    envelope_picture,
    report,
    rows_of_envelope,
    shown_columns,
    step_picture,
    table_of_cells,
    write_sheets,
)
from touchstone.reports.verdict.outcomes import HARD_CLASSES, Outcome
from touchstone.scenarios.difficulty.family import families, hard_names, hard_scene

COLUMNS = (("reference", "balanced"), ("bullet", "recommended"))


def results(quick=False, **fails):
    """Results of two families in which cells fail that `fails` names: family_engine = (level, class)."""
    scope = Scope(COLUMNS, chosen(["wedge", "tiles"]), quick)
    played = {}
    for cell in scope.cells():
        family, level = hard_names()[cell.scenario]
        at, name = fails.get(f"{family.name}_{cell.engine}", (None, "ok"))
        outcome = Outcome(name, "why") if level == at else Outcome("ok")
        played[cell] = Played(outcome, line_of(cell))
    return Envelope(scope, played)


def test_every_step_of_every_level_is_played():
    """All levels at the own step and at STEPS, or three levels at the own step."""
    full, quick = results(), results(quick=True)
    steps = {cell.dt for cell in full.played}
    assert steps == {1 / 60, *STEPS}
    levels = sum(len(family.levels) for family in full.scope.families)
    assert len(full.played) == levels * (4 + 3)  # Bullet's own step is one of STEPS
    assert {cell.dt for cell in quick.played} == {1 / 60, 1 / 240}
    assert len(quick.played) == 2 * 3 * 2


def test_the_line_plays_a_cell():
    """The command names scene, engine, profile and step."""
    cell = hard_cell("hard_wedge_90", "mujoco", "recommended", 1 / 540)
    assert line_of(cell) == "touchstone run hard_wedge_90 --engine mujoco --profile recommended --dt 1/540"


def test_survival_ends_at_the_first_failure():
    """A level counts only if all easier ones survive."""
    found = results(wedge_reference=(45.0, "jitter"))
    wedge = families()["wedge"]
    assert found.survived(wedge, ("reference", "balanced")) == (90.0, "jitter")
    assert found.survived(wedge, ("bullet", "recommended")) == (1.0, "")
    first = results(wedge_reference=(170.0, "exploded"))
    assert first.survived(wedge, ("reference", "balanced")) == (None, "exploded")


@pytest.mark.parametrize(
    ("fails", "share", "verdict"),
    [
        ({}, 1.0, "pass"),
        ({"tiles_reference": (16.0, "inaccurate")}, 0.5, "fail"),
        ({"tiles_reference": (16.0, "inaccurate"), "tiles_bullet": (16.0, "exploded")}, 1.0, "pass"),
        ({"tiles_bullet": (16.0, "exploded")}, 1.0, "pass"),
    ],
)
def test_containment_counts_levels_that_only_others_survive(fails, share, verdict):
    """A family is not contained where an engine survives a level that the reference does not."""
    (row,) = (row for row in rows_of_envelope(results(**fails)) if row.metric == CONTAINED)
    assert (row.value, row.verdict) == (share, verdict)
    assert ("tiles" in row.reason) == (share < 1)


def test_a_silent_failure_of_the_reference_breaks_a_limit():
    """Announced failures pass, silent ones fail with the command that plays them; engines are not judged."""
    for name, verdict in (("creep", "fail"), ("gave up", "pass"), ("slow", "pass")):
        found = results(tiles_reference=(1.0, name), tiles_bullet=(1.0, "exploded"))
        rows = [row for row in rows_of_envelope(found) if row.metric == OUTCOME and row.subject == name]
        assert {row.verdict for row in rows} == {verdict}
        assert all(row.reproduce.startswith("touchstone run hard_tiles_1 ") for row in rows)
        assert {row.verdict for row in rows_of_envelope(found) if row.engine == "bullet"} == {""}


def test_reading_is_not_the_engines_time():
    """A cell is slow by the time of its steps: slow reading ends no run."""
    scenario, checks = hard_scene("hard_strong_gravity_9.81")
    settings = Settings("any", 1 / 60)
    assert play_scenario(Engine("reads slowly"), scenario, checks, settings, 0.2).name == "ok"


def test_a_family_without_a_simulated_body_is_marked(shown):
    """The reference poses such a family: its rows say so, and those of engines do not."""
    posed = {name for name, family in families().items() if family.posed}
    assert {"coupling", "mass_links"} < posed
    assert "tiles" not in posed
    scope = Scope(COLUMNS, chosen(["coupling", "tiles"]), quick=True)
    rows = rows_of_envelope(
        Envelope(scope, {cell: Played(Outcome("ok"), line_of(cell)) for cell in scope.cells()})
    )
    marked = {(r.engine, r.scenario) for r in rows if r.basis == CONSTRUCTION and r.metric == LEVELS}
    assert marked == {("reference", "coupling")}
    assert "all =" in shown(report(table(rows)), 140)


def test_tables_and_pictures_show_every_class(shown, tmp_path):
    """Every class has a look; table, CSV and pictures take all of them."""
    assert set(LOOKS) == {*HARD_CLASSES, ""}
    found = results(tiles_reference=(16.0, "exploded"), wedge_bullet=(1.0, "skipped"))
    frame = table(rows_of_envelope(found))
    assert set(frame.metric) == {OUTCOME, LEVELS, STEP, CONTAINED}
    text = shown(report(frame), 140)
    assert "4 x" in text
    assert "touchstone run hard_tiles_16 --engine reference" in text
    assert set(table_of_cells(found).command) == {played.line for played in found.played.values()}
    envelope_picture(found, tmp_path / "all.png")
    step_picture(found, families()["tiles"], tmp_path / "one.png")
    assert (tmp_path / "all.png").stat().st_size > 10_000


def test_a_store_plays_nothing_twice(tmp_path):
    """A second study takes every cell from the store, with the same figures."""
    cells = [hard_cell("hard_wedge_90", "reference", "balanced", own_step("reference", "balanced"))]
    first = play_all(cells, tmp_path, lambda label, count: None, jobs=1)
    lines = []
    again = play_all(cells, tmp_path, lambda label, count: lines.append(label), jobs=1)
    assert repr(again) == repr(first)  # figures that do not apply are NaN
    assert lines == ["finished before"]
    assert first[cells[0]].outcome.name == "ok"
    assert first[cells[0]].outcome.figures["overlap [m]"] < 1e-6


def test_cells_for_the_eye_are_drawn_at_random_and_repeat():
    """A seed draws the same cells again; cells without a run are left out."""
    played = results(wedge_bullet=(170.0, "skipped")).played
    cells = drawn(played, 10, 3)
    assert len(set(cells)) == 10
    assert cells == drawn(played, 10, 3) != drawn(played, 10, 4)
    assert all(played[cell].outcome.name == "ok" for cell in drawn(played, 1000, 0))


def test_sheets_show_runs_without_their_classes(tmp_path):
    """The picture has a tile for each cell; its class and its command stand in a file of their own."""
    cell = hard_cell("hard_needle_5", "reference", "balanced", 1 / 60, 5.0)
    played = {cell: Played(Outcome("ok"), line_of(cell))}
    frame = write_sheets(played, 60, 0, tmp_path / "sheet", lambda label, cells: None)
    assert frame[["number", "scene", "outcome"]].values.tolist() == [[1, "hard_needle_5", "ok"]]
    assert sorted(path.name for path in (tmp_path / "sheet").iterdir()) == ["sheet-1.png", "sheet.csv"]
    assert (tmp_path / "sheet" / "sheet-1.png").stat().st_size > 5000


def test_engines_show_three_profiles_and_the_reference_one():
    """Default, recommended and the best, which may be one of them; few profiles are shown as they are."""
    counts = {
        **{("reference", name): 9 for name in ("balanced", "accurate", "paper")},
        ("dart", "accurate"): 7,
        ("dart", "default"): 5,
        ("dart", "recommended"): 6,
        ("bullet", "default"): 4,
        ("bullet", "recommended"): 4,
        ("bullet", "maximal"): 3,
        ("mujoco", "accurate"): 1,
    }
    assert shown_columns(counts) == {
        ("reference", "balanced"): "balanced",
        ("dart", "default"): "default",
        ("dart", "recommended"): "recommended",
        ("dart", "accurate"): "best: accurate",
        ("bullet", "default"): "best: default",
        ("bullet", "recommended"): "recommended",
        ("mujoco", "accurate"): "accurate",
    }
