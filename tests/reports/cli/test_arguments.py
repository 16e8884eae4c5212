"""Options of every command; wrong input is one clear line and exit 2; help imports nothing heavy."""

import json
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest
import typer

from touchstone.reports.bench import BENCHES
from touchstone.reports.changes import NEEDED
from touchstone.reports.cli import main
from touchstone.reports.results import Row, save, table
from touchstone.reports.studies.work_precision.study import Answer, MeasuredSetting, answer_rows
from touchstone.scenarios.catalogue import catalogue

HEAVY = ("numpy", "pandas", "numba", "scipy", "pyarrow", "mujoco", "pybullet", "dartpy", "coal", "fcl")


def test_help_imports_nothing_heavy():
    """`touchstone --help` names the commands and imports neither numpy, pandas, numba nor any engine."""
    code = (
        "import sys; sys.argv = ['touchstone', '--help']\n"
        "from touchstone.reports.cli.main import main\n"
        "try:\n    main()\nexcept SystemExit as end:\n"
        f"    print([m for m in {HEAVY} if m in sys.modules], end.code or 0, file=sys.stderr)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stderr.strip() == "[] 0"
    for command in ("run", "list", "show", "doctor"):
        assert command in done.stdout


def test_the_program_is_installed():
    """The console script runs, and a wrong name ends it with one line and no traceback."""
    program = Path(sys.executable).with_name("touchstone")
    if not program.exists():
        pytest.skip("the project is not installed with its script")
    done = subprocess.run([program, "run", "bal_snip"], capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("touchstone: unknown scenario 'bal_snip'; did you mean 'ball_snip'")
    assert done.stderr.endswith(f"? (valid: {len(catalogue())} names: touchstone list scenarios)\n")
    assert done.stderr.count("\n") == 1


USED = "exists and is not an empty folder"
WRITERS = (
    *("run slip", "study calibration", "study paper", "study agreement fall", "study narrow-phase --pairs 9"),
    *(f"bench {name}" for name in BENCHES),
)
WRONG = [
    ("run bal_snip", "unknown scenario 'bal_snip'; did you mean 'ball_snip'"),
    ("run --engine bulet", "unknown engine 'bulet'; did you mean 'bullet'?"),
    ("run --metric overlp.max", "unknown metric 'overlp.max'; did you mean 'overlap.max'"),
    ("run --tag galery", "unknown tag 'galery'; did you mean 'gallery'?"),
    ("run --tag ''", "unknown tag '' (valid: belt, collective, "),
    ("nightly --store ''", "--store: name a folder, or a URL"),
    ("run slip --tag probe", "--tag probe: scenes are named too; give one of both"),
    ("run --profile equal_step", "unknown profile 'equal_step'; did you mean 'equal-step'?"),
    ("run --engine dart --profile paper", "no engine of dart has the profile paper"),
    (
        "run fall --engine mujoco --engine reference --profile balanced",
        "no engine of mujoco has the profile balanced (valid: recommended, ",
    ),
    ("run --dt 1e-300", "--dt 1e-300: dt = 1e-300 s is 1.67e+298 steps a frame, expected at most 1000000"),
    (
        "run --dt '\u0661/\u0666\u0660'",
        "--dt \u0661/\u0666\u0660: expected a step in seconds, such as 1/240 or 0.005",
    ),
    ("run --dt 1_0/60", "--dt 1_0/60: expected a step in seconds"),
    ("run --engine mujoco --set 'impratio=\u0661'", "--set mujoco: impratio: found '\u0661'"),
    ("run --dt 1/7", "--dt 1/7: dt = 0.142857 s does not divide the frame of 1/60 s"),
    ("run --set removel=eq1", "--set reference: unknown setting 'removel'; did you mean 'removal'"),
    ("run --set mujco.cone=elliptic", "--set unknown engine 'mujco'; did you mean 'mujoco'"),
    ("run --engine mujoco --set cne=elliptic", "--set mujoco: unknown setting 'cne'; did you mean 'cone'?"),
    (
        "run --engine reference --set removal=eq2",
        "--set reference: removal: found 'eq2'; did you mean 'eq1'? (valid: eq1",
    ),
    ("run --engine reference --set removal", "--set reference: removal: found '' (valid: eq1|least_motion)"),
    (
        "run --engine reference --set event_rows=-1",
        "--set reference: event_rows: found '-1' (valid: whole, 0 to 1e+09)",
    ),
    ("run --engine reference --set event_rows=nan", "--set reference: event_rows: found 'nan'"),
    (
        "run --engine reference --set depth=exact --set depth=certified",
        "--set reference: depth: given as depth=exact and depth=certified",
    ),
    ("run --set removal=eq1", "--set dart: unknown setting 'removal'"),
    (
        "run --engine reference --profile paper --set depth=exact",
        "--set reference: depth: profile paper has no such setting: it has the numbers of the scene",
    ),
    ("run --tracker nosy", "unknown tracker 'nosy'; did you mean 'noisy'? (valid: ideal, noisy)"),
    ("run fall --tracker noisy", "--tracker noisy: no scene of this run has a tracker"),
    ("run --tracker noisy --drive posed", "--tracker noisy: kinematic links would jump; choose"),
    ("run --dt x", "--dt x: "),
    ("run --dt 1/0", "--dt 1/0: "),
    ("run --dt 0", "--dt 0: "),
    ("run --dt -1/60", "--dt -1/60: "),
    ("run --dt nan", "--dt nan: "),
    ("study calibration --engine reference --profile maximal", "no engine of reference has the profile"),
    ("study knobs --engine reference", "study knobs: varies other engines; the reference's settings: "),
    ("--engien dart", "No such option: --engien"),
    ("rnu", "No such command 'rnu'. Did you mean 'run'? (see touchstone --help)"),
    ("study ikk", "No such command 'ikk'. Did you mean 'ik'? (see touchstone study --help)"),
    ("list things", "Invalid value for 'what': "),
    ("run --out", "Option '--out' requires an argument"),
    ("show", "Missing argument 'scenario' (see touchstone show --help)"),
    ("show fall --format xml", "Invalid value for '--format': "),
    ("study ik --seed -1", "Invalid value for '--seed': "),
    ("show fall --model-card", "fall: no driven bodies, so no model card; robots have them if"),
    ("study convergence ball_snip", "no truth for ball_snip; valid: arch_stands, "),
    (
        "sweep fall --dt 1/70",
        "--dt 1/70: dt = 0.0142857 s does not divide the frame of 1/60 s (next to it: 1/60, 1/120)",
    ),
    ("sweep fall --dt 0", "--dt 0: dt = 0 s does not divide the frame of 1/60 s (such as 1/240)"),
    ("sweep fall --dt 1/x", "--dt 1/x: expected a step in seconds, such as 1/240 or 0.005"),
    ("sweep fall --engine mujoco --set bullet.solref=1", "--set bullet: unknown setting 'solref'"),
    ("sweep fall --engine mujoco --set impratio=1,x", "--set mujoco: impratio: found 'x' (valid: 0.001 to"),
    ("sweep fall --seed 0,x", "--seed 0,x: found 'x', expected numbers such as 0,1,2"),
    ("sweep fall --timing --dask local", "--timing --dask: times are measured on this machine"),
    ("sweep fall --part 3/3", "--part 3/3: expected K/N with K from 0 to N - 1"),
    ("cheapest fall --overlap 1", "--overlap 1: no unit; valid: m, cm, mm, um"),
    ("cheapest fall --energy 1J", "--energy 1J: unit 'J'; valid: %"),
    ("cheapest fall --frame-budget 4m", "--frame-budget 4m: unit 'm'; valid: s, ms, us"),
    ("cheapest fall", "cheapest: give a tolerance, such as --overlap 1mm"),
    ("tune fall --position 1mm", "tune: name the engine"),
    ("tune fall --engine mujoco --friction 2mm", "--friction 2mm: unit 'mm'; valid: %"),
    ("tune fall --engine mujoco --frame-budget 2ms", "tune: give a limit on an error"),
    ("tune --engine mujoco --position 1mm", "tune: name one scene, or a tag by --scenes"),
    ("tune --scenes prob --engine mujoco --position 1mm", "unknown tag 'prob'"),
    ("reproduce fall --engine reference", "fall: reference: no scripts in its own API are written for it"),
    ("study paper --repeats 0", "Invalid value for '--repeats': "),
    ("study paper --profile balanced", "No such option: --profile"),
    ("study narrow-phase --pairs many", "--pairs many: expected a number of pairs, or a file .json or .toml"),
    ("study narrow-phase --pairs missing.json", "missing.json: No such file or directory"),
    ("study narrow-phase --pairs 99999999999", "--pairs 99999999999: expected at most 10000000"),
    ("study narrow-phase --pairs 8", "--pairs 8: expected at least 9, one per family of poses"),
    ("study ik --goals 0", "--goals 0: expected at least 1"),
    *((f"{command} --out full", f"--out full: {USED}") for command in WRITERS),
    ("run slip --out full/mine", f"--out full/mine: {USED}"),
    ("run slip --out full/mine/deep/er", "--out full/mine/deep/er: Not a directory"),
    ("run slip --out .", "--out .: give the folder a name of its own"),
    ("run slip --out ..", "--out ..: give the folder a name of its own"),
    *((f"soak --minutes {number}", "Invalid value for '--minutes': ") for number in ("inf", "nan", "1e300")),
    ("study ik --goals 999999999999", "Invalid value for '--goals': "),
    ("study robustness --scenes 999999999999", "Invalid value for '--scenes': "),
    ("study robustness --perturbation inf", "Invalid value for '--perturbation': "),
    ("sweep fall --seed \u0663", "--seed \u0663: found '\u0663', expected numbers"),
    ("sweep fall --part \u0660/\u0663", "--part \u0660/\u0663: expected K/N"),
    ("cheapest fall --position \u0661mm", "--position \u0661mm: expected a number of m"),
]
"""Command -> how its line begins; `full` is a folder with a file."""


@pytest.mark.parametrize(("command", "said"), WRONG)
def test_wrong_input_is_one_line(refused, tmp_path, command, said, left):
    """Exit 2 and one line with the place and the nearest valid; nothing is played or written."""
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "mine").write_text("kept")
    assert refused(command).startswith(said)
    assert (left(tmp_path), (tmp_path / "full" / "mine").read_text()) == (["full"], "kept")


def test_an_unknown_engine_may_be_one_of_ones_own(refused):
    """The valid names say how an engine that is not installed is named."""
    assert refused("run --engine my_engine").endswith(", module:Class)")


@pytest.mark.parametrize("command", ["", "study"])
def test_no_command_is_answered_with_all(touchstone, command):
    """Without a command the help is printed, and the end is that of wrong usage."""
    code, out, err = touchstone(command)
    assert (code, err) == (2, "")
    assert "Commands" in out


def test_an_endless_file_is_refused(refused, tmp_path):
    """A document of 100 GB is not read."""
    for name in ("old/results.csv", "huge.toml"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
    (tmp_path / "old" / "results.csv").write_text(",".join(NEEDED) + "\n")
    with open(tmp_path / "huge.toml", "wb") as file:
        file.truncate(10**11)
    for command in ("compare old old --tolerance huge.toml", "show huge.toml"):
        assert refused(command) == "huge.toml: 1e+05 MB, expected at most 100 MB"


WITHOUT = {
    "nightly": {"--format": "its folder has the table", "--out": "a night belongs to its --store"},
    "challenge": {"--format": "prints two counts; its folder has both tables"},
    "accept": {"--format": "one line", "--out": "one line", "--quiet": "one line"},
    "failings measure": {
        "--format": "prints what changed",
        "--out": "writes the table of known failings",
        "--quiet": "prints what changed",
    },
    "env add": {"--format": "one line", "--out": "one line", "--quiet": "one line"},
    "env list": {"--quiet": "has no verdict"},
    "env remove": {"--format": "one line", "--out": "one line", "--quiet": "one line"},
    "docs": {"--format": "writes pages", "--quiet": "prints their paths"},
    "schema": {"--format": "is JSON", "--quiet": "prints nothing else"},
    "export": {"--quiet": "prints a path"},
    "reproduce": {"--format": "writes a program"},
    "view": {"--format": "writes a page", "--quiet": "prints its path"},
    "list": {"--quiet": "has no verdict"},
    "show": {"--quiet": "has no verdict"},
}
"""Options that a command does not have, and why."""


def commands():
    """Every command by its name, those of groups too."""
    top = typer.main.get_command(main.app)
    for name, command in top.commands.items():
        inner = getattr(command, "commands", None)
        yield from (
            {f"{name} {sub}": one for sub, one in inner.items()}.items() if inner else [(name, command)]
        )


@pytest.mark.parametrize(
    ("name", "command"), list(commands()), ids=lambda part: part if isinstance(part, str) else ""
)
def test_commands_have_the_same_options(name, command):
    """Every command has all three, but for those whose reason WITHOUT states."""
    has = {option for parameter in command.params for option in parameter.opts}
    assert {"--format", "--out", "--quiet"} - has == WITHOUT.get(name, {}).keys()


@pytest.fixture
def runs(tmp_path):
    """Two runs; in the second a metric is worse."""
    for name, value in (("a", 1.0), ("b", 2.0)):
        (tmp_path / name).mkdir()
        row = Row("run", "fall", "mujoco", "recommended", 0.01, "truth.position", value, "1")
        save(table([row]), tmp_path / name)


def test_what_is_printed_goes_to_a_new_file(touchstone, refused, tmp_path):
    """`--out` leaves standard output empty, and replaces no file."""
    assert touchstone("list profiles --format json --out p.json")[:2] == (0, "")
    assert json.loads((tmp_path / "p.json").read_text())
    assert "--out p.json: exists" in refused("list profiles --out p.json")
    assert touchstone("schema --out s.json")[0] == 0
    assert json.loads((tmp_path / "s.json").read_text())["title"] == "touchstone scene"
    said = refused("list profiles --out no/such/p.json")
    assert said == "--out no/such/p.json: No such file or directory"


def test_a_verdict_is_written_with_its_exit_code(touchstone, runs, tmp_path):
    """A comparison that is worse writes its table, or names it under `--quiet`, and exits with 1; one that is
    refused writes nothing; where all is well `--quiet` prints nothing."""
    assert touchstone("compare a b --format csv --out c.csv")[:2] == (1, "")
    assert pd.read_csv(tmp_path / "c.csv").kind.tolist() == ["worse"]
    said = "worse: fall mujoco recommended truth.position: by 1.00\n"
    assert touchstone("compare a b --quiet") == (1, "", said)
    assert touchstone("compare a a --quiet") == (0, "", "")
    assert touchstone("compare a none --out d.csv")[0] == 2
    assert not (tmp_path / "d.csv").exists()


@pytest.mark.slow
def test_doctor_is_read_by_programs(touchstone):
    """Every engine has a status; `--quiet` prints what fails alone."""
    code, out, err = touchstone("doctor --format json")
    found = {row["name"]: row for row in json.loads(out)}
    assert found["reference"]["status"] == "done", err
    assert found["drake"]["status"] in ("done", "missing")
    assert found["kernel cache"]["value"]
    code, out, err = touchstone("doctor --quiet")
    assert (code, out) == (0, "")
    assert {line.partition(":")[0] for line in err.splitlines()} <= {
        name for name, row in found.items() if row["status"] not in ("", "done")
    }


def test_the_cheapest_setting_is_read_by_programs():
    """A row per setting with its place, errors and command; JSON has no infinity."""

    def setting(engine, t, overlap):
        errors = {"overlap": overlap, "energy": 0.1}
        return MeasuredSetting(engine, "balanced", "", 1 / 60, t, t, t, errors, 0.5, "overlap", "again")

    one, two = setting("reference", 1.0, 1e-6), setting("mujoco", 2.0, 1e-4)
    three = setting("bullet", 3.0, float("inf"))
    found = answer_rows(Answer(True, one, two, three, (two,)), {"overlap": 1e-3})
    assert [(row["place"], row["engine"]) for row in found] == [
        ("cheapest", "reference"),
        ("cannot tell apart", "mujoco"),
        ("next engine", "bullet"),
    ]
    assert found[0]["error overlap"] == 1e-6
    assert found[0]["limit overlap"] == 1e-3
    assert "error energy" not in found[0]
    assert json.loads(json.dumps(found, allow_nan=False))[2]["error overlap"] is None
