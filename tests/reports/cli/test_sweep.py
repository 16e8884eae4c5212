"""`touchstone sweep` and `cheapest`: wrong input is one line, and what was measured stays."""

import shlex
import subprocess
from io import StringIO

import pandas as pd
import pytest

from touchstone.adapters.registry import installed, missing_reason


def test_a_sweep_is_printed_and_kept(touchstone, tmp_path):
    """Steps and settings make cells, the second call measures none, another version is refused."""
    asked = (
        "sweep",
        "fall",
        "--engine",
        "mujoco",
        "--profile",
        "recommended",
        "--jobs",
        "1",
        "--dt",
        "1/60,1/240",
    )
    code, out, err = touchstone(*asked, "--set", "mujoco.integrator=Euler,RK4", "--set", "numSubSteps=1,2")
    assert code == 0, err
    assert "4 cells" in out
    assert "integrator=RK4" in out
    files = sorted((tmp_path / "runs" / "sweep" / "cells").iterdir())
    code, out, _ = touchstone(*asked, "--set", "mujoco.integrator=Euler,RK4", "--format", "csv", "--quiet")
    assert code == 0
    assert out.count("\n") > 40
    assert sorted((tmp_path / "runs" / "sweep" / "cells").iterdir()) == files
    (tmp_path / "runs" / "sweep" / "store.json").write_text('{"format": 99}')
    code, _, err = touchstone(*asked)
    assert (code, err) == (2, "touchstone: runs/sweep: store of version 99, this program writes 1\n")


@pytest.mark.parametrize(
    "command",
    [
        "sweep fall --jobs 1",
        "cheapest fall --position 1mm --quick --jobs 1",
        "tune fall --position 1mm --quick --jobs 1",
        "check-engine",
        "run fall",
        "study calibration",
        "study convergence slip",
        "study effects fall",
        "study relations",
        "study robustness",
        "study stability",
        pytest.param("study work-precision fall --quick --jobs 1", marks=pytest.mark.slow),
    ],
)
def test_a_missing_engine_is_told_in_quiet(touchstone, command):
    """Exit 3 has its line under `--quiet`, for an engine without our usual profiles too."""
    if installed("drake"):
        pytest.skip("drake is installed")
    engine = ["drake"] if command == "check-engine" else ["--engine", "drake"]
    code, out, err = touchstone(*command.split(), *engine, "--quiet")
    assert (code, out) == (3, ""), err
    assert missing_reason("drake") in err


def test_a_slurm_script_is_written(touchstone, tmp_path):
    """The script repeats the command with an absolute store, and nothing is measured."""
    code, out, _ = touchstone(
        "sweep", "fall", "--engine", "mujoco", "--slurm-script", "job.sh", "--jobs", "4"
    )
    assert (code, out) == (0, "sbatch job.sh\n")
    text = (tmp_path / "job.sh").read_text()
    assert f"--engine mujoco --out {tmp_path}/runs/sweep --jobs 1" in text
    assert "slurm-script" not in text
    assert subprocess.run(["bash", "-n", "job.sh"], cwd=tmp_path, check=False).returncode == 0
    for name, said in (("job.sh", "exists"), ("no/job.sh", "No such file or directory")):
        code, out, err = touchstone("sweep", "fall", "--engine", "mujoco", "--slurm-script", name)
        assert (code, out, err) == (2, "", f"touchstone: --slurm-script {name}: {said}\n")
    assert (tmp_path / "job.sh").read_text() == text
    assert sorted(path.name for path in tmp_path.iterdir()) == ["job.sh"]


@pytest.mark.slow
def test_the_line_of_an_answer_meets_its_tolerances(touchstone):
    """The command that `cheapest` names, run again, has the overlap that was asked for."""
    code, out, err = touchstone("cheapest", "bounce_e05", "--overlap", "5mm", "--engine", "bullet", "--quick")
    assert code == 0, err
    line = next(text for text in out.splitlines() if text.startswith("again: touchstone "))
    again = shlex.split(line.removeprefix("again: touchstone "))
    code, out, err = touchstone(*again, "--format", "csv", "--quiet", "--metric", "overlap.max")
    found = pd.read_csv(StringIO(out))
    assert found[found.metric == "overlap.max"].value.max() <= 5e-3
    code, out, _ = touchstone("cheapest", "bounce_e05", "--overlap", "1um", "--engine", "bullet", "--quick")
    assert code == 1
    assert out.startswith("nothing measured meets all; nearest miss: bullet ")
    assert "times too much" in out


def test_seeds_and_times(touchstone):
    """A seed perturbs the scene and has a line of its own; each cell is timed in as many rounds as asked."""
    asked = ("sweep", "collide_sticks", "--engine", "mujoco", "--profile", "recommended", "--jobs", "1")
    asked = (*asked, "--seed", "0,1", "--timing", "--repeats", "2")
    code, out, err = touchstone(*asked, "--format", "csv", "--quiet")
    assert code == 0, err
    frame = pd.read_csv(StringIO(out))
    runs = frame[frame.metric == "run"]
    kinds = runs.measure.str.rpartition(":")[2].value_counts().to_dict()
    assert kinds == {"accuracy": 2, "timing": 4}
    assert runs[runs.measure.str.endswith("timing")].value.min() > 0
    ends = frame[(frame.metric == "overlap.max") & frame.measure.str.endswith("accuracy")]
    assert sorted(ends.seed) == [0, 1]
    code, out, _ = touchstone(*asked)
    assert code == 0
    assert "frame [us]" in out
    assert "seed" in out
