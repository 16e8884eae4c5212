"""Sweeps: every cell is measured once, whatever happens to the processes, the store or the disk."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from fake_measures import fake_cells, load
from fake_world import FakeEngine

from touchstone.adapters.contract import Unsupported
from touchstone.adapters.knobs import SettingError
from touchstone.reports.runner import sweep as executors
from touchstone.reports.runner.cells import combinations, grid
from touchstone.reports.runner.store import Store, StoreError
from touchstone.reports.runner.sweep import (
    ClusterError,
    DaskPool,
    InPool,
    PartError,
    part_of,
    play_cell,
    script,
    sweep,
)

SHARED = str(Path(__file__).parents[2] / "shared")
"""Folder of what processes of their own import."""


def test_a_grid_has_every_combination_once():
    """Repeated names and values give no repeated cells."""
    columns = [("mujoco", "recommended"), ("mujoco", "recommended"), ("bullet", "recommended")]
    cells = grid(["fall", "slide"], columns, steps=[1 / 60, 1 / 240], repeats=3)
    assert len(cells) == len(set(cells)) == 2 * 2 * 2 * 3


def test_settings_concern_the_engines_that_have_them():
    """An engine plays all combinations of its own settings; others are no reason to refuse."""
    asked = ["impratio=1,3", "mujoco.solver=CG,Newton", "numSolverIterations=10,50"]
    assert combinations("mujoco", "recommended", asked) == [
        ("solver=CG",),
        (),
        ("solver=CG", "impratio=3.0"),
        ("impratio=3.0",),
    ]
    assert combinations("bullet", "recommended", asked) == [("numSolverIterations=10",), ()]
    assert combinations("dart", "recommended", asked) == [()]
    assert combinations("dart", "recommended", []) == [()]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("impratoi=3", "mujoco: unknown setting 'impratoi'; did you mean 'impratio'"),
        ("impratio=x", "mujoco: impratio: found 'x' .valid: 0.001 to"),
        ("impratio=", "mujoco: impratio: found '' .valid: 0.001 to"),
        ("mujco.impratio=1", "unknown engine 'mujco'; did you mean 'mujoco'"),
    ],
)
def test_what_no_engine_has_is_refused(text, said):
    """The nearest names and the valid values are named."""
    with pytest.raises(SettingError, match=said):
        combinations("mujoco", "recommended", [text])


TIMES = ("run", "frames", "seconds")
"""Rows whose values are times."""


def rows(frame):
    """Rows without what another run or machine changes."""
    plain = frame[~frame.metric.isin(TIMES)].drop(columns=["machine", "series"])
    return plain.sort_values(["cell", "metric", "subject"], ignore_index=True)


def paths(frame):
    """Paths of the bodies of every cell."""
    part = frame[frame.metric == "path"]
    return {cell: tuple(series) for cell, series in zip(part.cell, part.series)}


@pytest.mark.slow
def test_a_dask_cluster_gives_the_rows_of_a_pool(tmp_path):
    """Four engines, a smooth and a chaotic scene: all values and paths are identical to the bit."""
    pytest.importorskip("distributed")
    cells = grid(
        ["fall", "ball_snip"],
        [
            ("reference", "balanced"),
            ("dart", "recommended"),
            ("bullet", "recommended"),
            ("mujoco", "recommended"),
        ],
        steps=(1 / 240,),
    )
    local = sweep(cells, tmp_path / "pool", jobs=2, series=True)
    remote = sweep(cells, tmp_path / "dask", executor=lambda out: DaskPool("local", 2, out), series=True)
    assert rows(local).equals(rows(remote))
    assert paths(local) == paths(remote)
    assert len(paths(local)) == len(cells)


@pytest.mark.slow
def test_a_cluster_keeps_going(tmp_path, monkeypatch):
    """A cell that crashes its worker, or hangs, is a row; all others are measured."""
    pytest.importorskip("distributed")
    monkeypatch.setenv("PYTHONPATH", SHARED, prepend=os.pathsep)
    frame = sweep(
        [cell for cell in fake_cells("faulty", 9) if cell.seed != 5],
        tmp_path / "s",
        executor=lambda output: DaskPool("local", 1, output, load, 60),
    )
    runs = frame[frame.metric == "run"].set_index("seed")
    assert runs.outcome.to_dict() == {
        k: {3: "crash", 7: "diverged"}.get(k, "done") for k in (0, 1, 2, 3, 4, 6, 7, 8)
    }


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:9", "nonsense"])
def test_an_unreachable_cluster_is_one_line(tmp_path, monkeypatch, address):
    """The address is named, and what the store holds stays."""
    pytest.importorskip("distributed")
    monkeypatch.setattr("touchstone.reports.runner.sweep.CONNECT_SECONDS", 1)
    with pytest.raises(ClusterError, match=f"^--dask {address}: cannot be reached [^\n]*$"):
        sweep(fake_cells("square", 1), tmp_path / "s", executor=lambda output: DaskPool(address, 1, output))
    assert Store(tmp_path / "s").table().empty


def test_parts_cover_all_cells_once():
    """Parts of an array are disjoint and complete."""
    cells = fake_cells("square", 23)
    parts = [part_of(cells, f"{k}/5") for k in range(5)]
    assert sorted((cell for part in parts for cell in part), key=lambda cell: cell.seed) == cells
    for text in ("5/5", "-1/5", "1", "a/b", "1/0", ""):
        with pytest.raises(PartError, match="expected K/N"):
            part_of(cells, text)


def test_a_slurm_script_is_sound(tmp_path):
    """bash accepts it; its tasks call the sweep with their part, and quotes survive."""
    calls = tmp_path / "touchstone"
    calls.write_text(f'#!/bin/bash\nprintf "%s\\n" "$@" >> {tmp_path}/calls.txt\n')
    calls.chmod(0o755)
    text = script(["fall", "--set", "mujoco.solimp=0.9:0.95:0.001:0.5:2", "--out", "/a b/store"], 3)
    assert "#SBATCH --array=0-2\n" in text
    for task in range(3):
        subprocess.run(
            ["bash"],
            input=text,
            text=True,
            check=True,
            env={"PATH": f"{tmp_path}:/usr/bin:/bin", "SLURM_ARRAY_TASK_ID": str(task)},
        )
    reported = (tmp_path / "calls.txt").read_text().splitlines()
    assert [line for line in reported if line.endswith("/3")] == ["0/3", "1/3", "2/3"]
    assert reported.count("/a b/store") == 3
    assert sys.executable not in text


PATIENCE = 4.0


def pool(jobs=1, patience=PATIENCE):
    """Executor of fake engines."""
    return lambda output: InPool(jobs, output, load, patience)


def squares(frame):
    """Value of each seed."""
    return dict(frame[frame.metric == "square"][["seed", "value"]].itertuples(index=False))


def test_cells_are_played_once(tmp_path):
    """A second sweep measures only what the first did not, and returns all rows in the cells' order."""
    sweep(fake_cells("square", 5), tmp_path / "s", executor=pool())
    files = set((tmp_path / "s" / "cells").iterdir())
    frame = sweep(fake_cells("square", 8), tmp_path / "s", executor=pool())
    assert squares(frame) == {k: k**2 for k in range(8)}
    assert list(dict.fromkeys(frame.seed)) == list(range(8))
    assert files < set((tmp_path / "s" / "cells").iterdir())


def test_what_ends_a_cell_is_a_row(tmp_path):
    """A crash, a hang, a divergence and an exception cost their own cell only."""
    frame = sweep(fake_cells("faulty", 12), tmp_path / "s", executor=pool(2))
    runs = frame[frame.metric == "run"].set_index("seed")
    assert runs.outcome[runs.outcome != "done"].to_dict() == {
        3: "crash",
        5: "hang",
        7: "diverged",
        9: "error",
    }
    assert runs.reason[3] == "died during 'play': exit code 7"
    assert "no answer" in runs.reason[5]
    assert runs.reason[9] == "ZeroDivisionError: one"
    assert set(squares(frame)) == set(range(12)) - {3, 5, 7, 9}
    assert set(runs.verdict) == {"", "error"}


SCRIPT = """
import sys
from pathlib import Path
sys.path[:0] = [sys.argv[1]]
from fake_measures import fake_cells, load
from touchstone.reports.runner.sweep import InPool
from touchstone.reports.runner.sweep import sweep
if __name__ == "__main__":
    sweep(fake_cells("slow", 60, ("ms=20",)), Path(sys.argv[2]), executor=lambda out: InPool(1, out, load))
"""


@pytest.mark.parametrize("kills", [1, pytest.param(5, marks=pytest.mark.slow)])
def test_a_kill_loses_cells_in_flight_only(tmp_path, kills):
    """After kill -9 at random moments the store is sound, and the next sweep plays only what is missing."""
    script, store = tmp_path / "script.py", tmp_path / "s"
    script.write_text(SCRIPT)
    before = None
    for moment in np.random.default_rng(15).uniform(0.0, 0.4, kills):
        files = set(store.glob("cells/*"))
        process = subprocess.Popen([sys.executable, str(script), SHARED, str(store)], start_new_session=True)
        while set(store.glob("cells/*.parquet")) <= files and process.poll() is None:
            time.sleep(0.01)
        time.sleep(moment)
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        found = Store(store).table()
        assert (found.groupby("cell").size() == 3).all()
        assert before is None or found[found.cell.isin(before.cell)].equals(before)
        before = found
    after = sweep(fake_cells("slow", 60, ("ms=20",)), store, executor=pool())
    assert squares(after) == {k: k**2 for k in range(60)}
    old = after[after.cell.isin(before.cell)].sort_values(["seed", "metric"], ignore_index=True)
    assert old.equals(before.sort_values(["seed", "metric"], ignore_index=True))


def test_files_are_merged_without_loss(tmp_path, monkeypatch):
    """Many small files become one; a merge that is cut off leaves every cell once."""
    store = Store(tmp_path / "s")
    sweep(fake_cells("square", 30), store.folder, executor=pool())
    rows = store.table()
    files = sorted(store.folder.glob("cells/*.parquet"))
    monkeypatch.setattr(Path, "unlink", lambda path, missing_ok=False: None)
    store.merge()
    monkeypatch.undo()
    assert len(list(store.folder.glob("cells/*.parquet"))) == len(files) + 1
    assert store.table().equals(rows)
    store.merge()
    assert len(list(store.folder.glob("cells/*.parquet"))) == 1
    assert store.table().equals(rows)


def test_a_damaged_store_is_refused_in_one_line(tmp_path):
    """A half-written file, another version and a folder that is no store are named; nothing is removed."""
    store = tmp_path / "s"
    sweep(fake_cells("square", 2), store, executor=pool())
    file = next(store.glob("cells/*.parquet"))
    whole = file.read_bytes()
    file.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(StoreError, match=f"{file.name}: not a complete Parquet file"):
        sweep(fake_cells("square", 2), store, executor=pool())
    file.write_bytes(whole)
    (store / "store.json").write_text('{"format": 0}')
    with pytest.raises(StoreError, match="store of version 0, this program writes 1"):
        sweep(fake_cells("square", 2), store, executor=pool())
    (store / "store.json").write_text("{")
    with pytest.raises(StoreError, match="not the description of a store"):
        sweep(fake_cells("square", 2), store, executor=pool())
    with pytest.raises(StoreError, match=f"is no store of a sweep .it holds {store.name}"):
        sweep(fake_cells("square", 2), tmp_path, executor=pool())
    assert [path.name for path in tmp_path.iterdir()] == [store.name]


def test_a_full_disk_keeps_what_was_measured(tmp_path, monkeypatch):
    """A batch that cannot be written ends the sweep with one line; earlier batches stay."""
    store = Store(tmp_path / "s")
    sweep(fake_cells("square", 3), store.folder, executor=pool())
    rows = store.table()

    def full(table, path, **options):
        Path(path).write_bytes(b"PAR1")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("pyarrow.parquet.write_table", full)
    with pytest.raises(StoreError, match="No space left on device; what is there is kept"):
        sweep(fake_cells("square", 6), store.folder, executor=pool())
    monkeypatch.undo()
    assert store.table().equals(rows)
    assert not list(store.folder.rglob("*.part"))


def test_ten_thousand_cells_are_resumed_at_once(tmp_path):
    """10,000 finished cells are hashed, found and read in under 5 s of processor time."""
    store = Store(tmp_path / "s")
    cells = fake_cells("square", 10_000)
    with store.opened():
        for first in range(0, 10_000, 100):
            store.append([play_cell(load("mujoco"), cell) for cell in cells[first : first + 100]])
    start = time.process_time()
    frame = sweep(cells, store.folder, executor=pool())
    assert time.process_time() - start < 5
    assert frame.cell.nunique() == 10_000


def test_the_measure_decides_what_a_refused_warm_up_means(monkeypatch):
    """A process whose first scene is refused still measures: the measure says what a refusal is."""

    class Choosy(FakeEngine):
        def build(self, scenario, settings):
            raise Unsupported("no balls")

    monkeypatch.setattr(executors, "_warm", set())
    (cell,) = fake_cells("square", 1)
    assert play_cell(Choosy(), cell).outcome == "done"
    assert executors._warm == set()
    assert play_cell(FakeEngine(), cell).outcome == "done"
    assert executors._warm == {"mujoco"}
