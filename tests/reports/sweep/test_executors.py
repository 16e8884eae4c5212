"""The same cells give the same rows on a pool, a Dask cluster and the tasks of a Slurm array."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from touchstone.reports.sweep.cells import grid
from touchstone.reports.sweep.clusters import ClusterError, DaskPool, PartError, part_of, script
from touchstone.reports.sweep.store import Store
from touchstone.reports.sweep.sweep import sweep

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
def test_a_cluster_keeps_going(fakes, tmp_path, monkeypatch):
    """A cell that crashes its worker, or hangs, is a row; all others are measured."""
    pytest.importorskip("distributed")
    from fake_measures import load

    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent), prepend=os.pathsep)
    frame = sweep(
        [cell for cell in fakes("faulty", 9) if cell.seed != 5],
        tmp_path / "s",
        executor=lambda output: DaskPool("local", 1, output, load, 60),
    )
    runs = frame[frame.metric == "run"].set_index("seed")
    assert runs.outcome.to_dict() == {
        k: {3: "crash", 7: "diverged"}.get(k, "done") for k in (0, 1, 2, 3, 4, 6, 7, 8)
    }


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:9", "nonsense"])
def test_an_unreachable_cluster_is_one_line(fakes, tmp_path, monkeypatch, address):
    """The address is named, and what the store holds stays."""
    pytest.importorskip("distributed")
    monkeypatch.setattr("touchstone.reports.sweep.clusters.CONNECT_SECONDS", 1)
    with pytest.raises(ClusterError, match=f"^--dask {address}: cannot be reached [^\n]*$"):
        sweep(fakes("square", 1), tmp_path / "s", executor=lambda output: DaskPool(address, 1, output))
    assert Store(tmp_path / "s").table().empty


def test_parts_cover_all_cells_once(fakes):
    """Parts of an array are disjoint and complete."""
    cells = fakes("square", 23)
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
