"""Wrong input: one clear line with the nearest valid, exit 2, nothing written; help imports nothing heavy."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from touchstone.reports.compare.stored import NEEDED
from touchstone.scenarios.catalogue import catalogue

HEAVY = ("numpy", "pandas", "numba", "scipy", "pyarrow", "mujoco", "pybullet", "dartpy", "coal", "fcl")
REFERENCE = ("--engine", "reference")


def test_help_imports_nothing_heavy():
    """`touchstone --help` names the commands and imports neither numpy, pandas, numba nor any engine."""
    code = (
        "import sys; sys.argv = ['touchstone', '--help']\n"
        "from touchstone.reports.cli.main import main\n"
        "try:\n    main()\nexcept SystemExit as end:\n"
        f"    print([m for m in {HEAVY} if m in sys.modules], end.code or 0, file=sys.stderr)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=30)
    assert done.stderr.strip() == "[] 0"
    for command in ("run", "list", "show", "doctor"):
        assert command in done.stdout


def test_the_program_is_installed():
    """The console script runs, and a wrong name ends it with one line and no traceback."""
    program = Path(sys.executable).with_name("touchstone")
    if not program.exists():
        pytest.skip("the project is not installed with its script")
    done = subprocess.run([program, "run", "bal_snip"], capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stdout) == (2, "")
    valid = ", ".join(catalogue())
    assert done.stderr.startswith("touchstone: unknown scenario 'bal_snip'; did you mean 'ball_snip'")
    assert done.stderr.endswith(f"? (valid: {valid})\n")
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["bal_snip"], "unknown scenario 'bal_snip'; did you mean 'ball_snip'"),
        (["--engine", "bulet"], "unknown engine 'bulet'; did you mean 'bullet'?"),
        (["--engine", "zzz"], "unknown engine 'zzz' (valid: reference, dart, bullet, mujoco"),
        (["--metric", "overlp.max"], "unknown metric 'overlp.max'; did you mean 'overlap.max'"),
        (["--tag", "galery"], "unknown tag 'galery'; did you mean 'gallery'?"),
        (["--profile", "equal_step"], "unknown profile 'equal_step'; did you mean 'equal-step'?"),
        (["--engine", "dart", "--profile", "paper"], "no engine of dart has the profile paper"),
        (
            ["--dt", "1e-300"],
            "--dt 1e-300: dt = 1e-300 s is 1.67e+298 steps a frame, expected at most 1000000",
        ),
        (
            ["--dt", "\u0661/\u0666\u0660"],
            "--dt \u0661/\u0666\u0660: expected a step in seconds, such as 1/240 or 0.005",
        ),
        (["--dt", "1_0/60"], "--dt 1_0/60: expected a step in seconds"),
        (["--engine", "mujoco", "--set", "impratio=\u0661"], "--set mujoco: impratio: found '\u0661'"),
        (["--dt", "1/7"], "--dt 1/7: dt = 0.142857 s does not divide the frame of 1/60 s"),
        (["--set", "removel=eq1"], "--set reference: unknown setting 'removel'; did you mean 'removal'"),
        (["--set", "x"], "--set reference: unknown setting 'x' (valid: v_rest, "),
        (["--set", "mujco.cone=elliptic"], "--set unknown engine 'mujco' (valid: reference, dart, "),
        (
            ["--engine", "mujoco", "--set", "cne=elliptic"],
            "--set mujoco: unknown setting 'cne'; did you mean 'cone'?",
        ),
        (
            [*REFERENCE, "--set", "removal=eq2"],
            "--set reference: removal: found 'eq2'; did you mean 'eq1'? (valid: eq1",
        ),
        ([*REFERENCE, "--set", "removal"], "--set reference: removal: found '' (valid: eq1|least_motion)"),
        (
            [*REFERENCE, "--set", "event_rows=-1"],
            "--set reference: event_rows: found '-1' (valid: whole, 0 to 1e+09)",
        ),
        ([*REFERENCE, "--set", "event_rows=2.5"], "--set reference: event_rows: found '2.5' (valid: whole"),
        ([*REFERENCE, "--set", "event_rows=nan"], "--set reference: event_rows: found 'nan'"),
        (
            [*REFERENCE, "--set", "depth=exact", "--set", "depth=certified"],
            "--set reference: depth: given as depth=exact and depth=certified",
        ),
        (["--set", "removal=eq1"], "--set dart: unknown setting 'removal'"),
        (
            [*REFERENCE, "--profile", "paper", "--set", "depth=exact"],
            "--set reference: depth: profile paper has no such setting: it has the numbers of the scene",
        ),
        (["--tracker", "nosy"], "unknown tracker 'nosy'; did you mean 'noisy'? (valid: ideal, noisy)"),
        (["fall", "--tracker", "noisy"], "--tracker noisy: no scene of this run has a tracker"),
        (["--tracker", "noisy", "--drive", "posed"], "--tracker noisy: kinematic links would jump; choose"),
        (["--dt", "x"], "--dt x: "),
        (["--dt", "1/0"], "--dt 1/0: "),
        (["--dt", "0"], "--dt 0: "),
        (["--dt", "-1/60"], "--dt -1/60: "),
        (["--dt", "nan"], "--dt nan: "),
        (["--dt", "1e400"], "--dt 1e400: "),
    ],
)
def test_wrong_input_is_one_line(touchstone, tmp_path, arguments, said, left):
    """A wrong argument ends in exit 2 and one line with it and the nearest valid; nothing is written."""
    code, out, err = touchstone("run", *arguments)
    assert (code, out) == (2, "")
    assert err.startswith(f"touchstone: {said}")
    assert err.count("\n") == 1
    assert left(tmp_path) == []


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--engine", "bulet"], "unknown engine 'bulet'; did you mean 'bullet'?"),
        (["--profile", "maxmal"], "unknown profile 'maxmal'; did you mean 'maximal'?"),
        (["--engine", "reference", "--profile", "maximal"], "no engine of reference has the profile maximal"),
        (["--out", "full"], "--out full: exists and is not an empty folder"),
    ],
)
def test_wrong_input_of_a_study_is_one_line(touchstone, tmp_path, arguments, said, left):
    """A wrong argument of `study calibration` ends in exit 2 and one line, and nothing is written."""
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "mine").touch()
    code, out, err = touchstone("study", "calibration", *arguments)
    assert (code, out) == (2, "")
    assert err.startswith(f"touchstone: {said}")
    assert err.count("\n") == 1
    assert left(tmp_path) == ["full"]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--engien", "dart"], "No such option: --engien"),
        (["rnu"], "No such command 'rnu'. Did you mean 'run'? (see touchstone --help)"),
        (["study", "ikk"], "No such command 'ikk'. Did you mean 'ik'? (see touchstone study --help)"),
        (["list", "things"], "Invalid value for 'what': "),
        (["run", "--out"], "Option '--out' requires an argument"),
        (["show"], "Missing argument 'scenario' (see touchstone show --help)"),
        (["show", "fall", "--format", "xml"], "Invalid value for '--format': "),
        (["study", "ik", "--seed", "-1"], "Invalid value for '--seed': "),
        (["show", "fall", "--model-card"], "fall: no driven bodies, so no model card (valid: arms_cross, "),
    ],
)
def test_wrong_usage_is_one_line(touchstone, arguments, said):
    """Unknown options, commands and kinds of lists end in exit 2 and one line with the place."""
    code, out, err = touchstone(*arguments)
    assert (code, out) == (2, "")
    assert err.startswith(f"touchstone: {said}")
    assert err.count("\n") == 1


@pytest.mark.parametrize("arguments", [[], ["study"]])
def test_no_command_is_answered_with_all(touchstone, arguments):
    """Without a command the help is printed, and the end is that of wrong usage."""
    code, out, err = touchstone(*arguments)
    assert (code, err) == (2, "")
    assert "Commands" in out


@pytest.mark.parametrize(
    "arguments",
    [
        ("soak", "--minutes", "inf"),
        ("soak", "--minutes", "nan"),
        ("soak", "--minutes", "1e300"),
        ("study", "narrow-phase", "--pairs", "999999999999"),
        ("study", "ik", "--goals", "999999999999"),
        ("study", "robustness", "--scenes", "999999999999"),
        ("study", "robustness", "--perturbation", "inf"),
        ("sweep", "fall", "--seed", "\u0663"),
        ("sweep", "fall", "--part", "\u0660/\u0663"),
        ("cheapest", "fall", "--position", "\u0661mm"),
    ],
)
def test_what_never_ends_is_refused(touchstone, tmp_path, arguments):
    """Numbers that let a command run for ever, and digits that are none of ASCII, are one line and exit 2."""
    code, out, err = touchstone(*arguments)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert arguments[-2].strip("-") in err
    assert not list(tmp_path.iterdir())


def test_an_endless_file_is_refused(touchstone, tmp_path):
    """A document of 100 GB is not read."""
    for name in ("old/results.csv", "huge.toml"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
    (tmp_path / "old" / "results.csv").write_text(",".join(NEEDED) + "\n")
    with open(tmp_path / "huge.toml", "wb") as file:
        file.truncate(10**11)
    line = "touchstone: huge.toml: 1e+05 MB, expected at most 100 MB\n"
    assert touchstone("compare", "old", "old", "--tolerance", "huge.toml") == (2, "", line)
    assert touchstone("show", "huge.toml") == (2, "", line)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["ball_snip"], "no truth for ball_snip; valid: arch_stands, "),
        (["sliderz"], "unknown scenario 'sliderz'; did you mean 'sliders'"),
        (["fall", "--engine", "bulet"], "unknown engine 'bulet'; did you mean 'bullet'?"),
    ],
)
def test_wrong_input_of_study_convergence_is_one_line(touchstone, tmp_path, arguments, said, left):
    """It refuses scenes without a truth, and names that are wrong, before it plays."""
    code, out, err = touchstone("study", "convergence", *arguments)
    assert (code, out) == (2, "")
    assert err.startswith(f"touchstone: {said}")
    assert err.count("\n") == 1
    assert left(tmp_path) == []
