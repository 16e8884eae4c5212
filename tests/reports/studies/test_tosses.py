"""The study `reality tosses`: tracked motions are read and checked, flights and impacts found, e and mu
identified.

`tosses/` has six tosses of DAIRLab/contact-nets (licence beside them).
"""

import shutil
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

from touchstone.adapters.registry import load
from touchstone.reports.studies.study import RefusedError
from touchstone.reports.studies.tosses import (
    COLUMNS,
    CUBE,
    OUTLIER,
    Box,
    Flown,
    Identification,
    State,
    first_impact,
    flights,
    prepared,
    read,
    rotated,
    settings,
)
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.closed_form import motion
from touchstone.scenarios.scenario import GRAVITY

TOSSES = Path(__file__).parent / "tosses"
COLUMN = ("reference", "balanced")
CELL = (0.3, 0.2)


@pytest.fixture(scope="module")
def measured():
    """The six tosses."""
    return read(TOSSES)


@pytest.fixture
def table(measured):
    """The first toss as a table for a CSV file."""
    toss = measured[1][0]
    poses = (toss.time, toss.position, toss.orientation.as_quat(scalar_first=True))
    return pd.DataFrame(np.column_stack(poses), columns=list(COLUMNS))


def test_a_csv_file_is_the_same_toss(table, measured, tmp_path):
    """A toss in both forms has the same flight and start."""
    table.to_csv(tmp_path / "toss.csv", index=False)
    box, tosses = read(tmp_path)
    (flight,), _ = flights(box, tosses)
    (other,), _ = flights(box, measured[1][:1])
    assert tosses[0].name == "toss"
    assert (flight.first, flight.last) == (other.first, other.last)
    np.testing.assert_allclose(flight.start.velocity, other.start.velocity, rtol=1e-9)


FAULTS = {
    "gap": (lambda t: t.drop(index=[30, 31]), r"a.csv: sample 30: a gap of 0.02027 s; samples are 0"),
    "hole": (lambda t: t.assign(x=t.x.where(t.index != 12)), r"a.csv: sample 12: expected finite numbers"),
    "order": (lambda t: t.iloc[[0, 2, 1, *range(3, len(t))]], r"a.csv: sample 2: time 0.00675\d* s does"),
    "length": (lambda t: t.assign(qw=t.qw * 1.1), r"a.csv: sample 0: quaternion of length 1\.\d+, ex"),
    "mm": (lambda t: t.assign(x=1e3 * t.x, y=1e3 * t.y, z=1e3 * t.z), r"a.csv: sample 89: .* lengths not in"),
    "ms": (lambda t: t.assign(time=1e3 * t.time), r"a.csv: sample \d+: it falls at .* time not in s"),
    "xyzw": (lambda t: t.rename(columns=dict(zip(("qw", "qz"), ("qz", "qw")))), r"quaternions not wxyz"),
    "column": (lambda t: t.drop(columns="qz"), r"a.csv: no column 'qz'; expected time,x,y,z,qw,qx,qy,qz"),
    "short": (lambda t: t[:4], r"a.csv: 4 samples, expected at least 10"),
    "unrested": (lambda t: t[:40], r"a.csv"),
}  # fmt: skip


@pytest.mark.parametrize("fault", FAULTS)
def test_a_wrong_file_is_refused_with_its_place(fault, table, tmp_path):
    """One line with file and sample."""
    change, said = FAULTS[fault]
    change(table).to_csv(tmp_path / "a.csv", index=False)
    with pytest.raises(RefusedError, match=said) as refused:
        read(tmp_path)
    assert "\n" not in str(refused.value)


BODIES = {
    "half_extents = [0.03, 0.0524, 0.0524]\nmass = 1": "another body",
    "half_extents = [0.0524, 0.0524]\nmass = 1": "expected half_extents",
    "half_extents = [0.05, 0.05, 0.05]": "mass",
    "half_extents = [0.05, 0.05, 0.05]\nmass = -1": "positive",
    "half_extents = [0.05, 0.05, 0.05]\nmass = 1\ninertia = [3, 1, 1]": "one moment exceeds",
    "half_extents =": "expected half_extents",
}


@pytest.mark.parametrize("text", BODIES)
def test_a_wrong_body_is_refused(text, tmp_path):
    """A body that is no box, or not the one of the tosses."""
    shutil.copytree(TOSSES, tmp_path, dirs_exist_ok=True)
    (tmp_path / "body.toml").write_text(text)
    with pytest.raises(RefusedError, match=BODIES[text]):
        read(tmp_path)


def test_a_damaged_archive_is_refused(tmp_path, refused):
    """No tosses, an archive that is none, and one that lacks an array: one line, exit 2."""
    for write in (
        lambda: None,
        lambda: (tmp_path / "tosses.npz").write_text("no archive"),
        lambda: np.savez(tmp_path / "tosses.npz", first=[0, 1]),
    ):
        write()
        assert str(tmp_path) in refused("reality tosses", tmp_path)


def test_a_free_box_rotates_as_the_closed_form_says():
    """Euler's equations against elliptic functions, about the unstable axis."""
    scene = catalogue()["tumble_unstable"]
    body, truth = scene.bodies[0], scene.truths[0]
    times = np.linspace(0.0, 3.0, 50)
    box = Box(body.pieces[0].shape.half_extents, body.mass, tuple(np.diag(body.inertia)))
    found = rotated(Rotation.identity(), np.array(body.angular_velocity), times, box)
    expected = Rotation.from_quat(motion(scene, truth, times).orientation, scalar_first=True)
    assert (found * expected.inv()).magnitude().max() < 1e-6


def test_noise_and_start_of_flight_are_found():
    """A cube with known noise, held by a hand for 20 samples: noise, start and beginning of its flight."""
    rng, toss = np.random.default_rng(0), read(TOSSES)[1][0]
    time = np.arange(len(toss.time)) / 148
    held, velocity, spin = 20, np.array((0.5, -0.2, 0.4)), np.array((3.0, 8.0, -2.0))
    since = np.maximum(time - time[held], 0.0)[:, None]
    position = (0.0, 0.0, 0.3) + velocity * since - (0.0, 0.0, GRAVITY / 2) * since**2
    noise, turn = 1e-4, 1e-3
    tracked = position + noise * rng.standard_normal(position.shape)
    turned = Rotation.from_rotvec(turn * rng.standard_normal(position.shape)) * Rotation.from_rotvec(
        spin * since
    )
    low = CUBE.corners(position, Rotation.from_rotvec(spin * since))[..., 2].min(axis=1)
    one = type(toss)("0", time, tracked, turned, low, toss.rest)
    (flight,), found = flights(CUBE, [one])
    assert held <= flight.first <= held + 3
    assert found == pytest.approx((noise, turn), rel=0.3)
    since = time[flight.first] - time[held]
    spread = OUTLIER * np.sqrt(flight.covariance[1, 1])
    assert flight.start.velocity + (0, 0, GRAVITY * since) == pytest.approx(velocity, abs=spread * noise)
    assert flight.start.spin == pytest.approx(spin, abs=spread * turn)


@pytest.mark.parametrize("impact", [0.1, 0.1031, 0.1066])
def test_the_first_impact_is_where_the_arcs_meet(impact):
    """A bounce between samples, to a tenth of a sample."""
    time = np.arange(40) / 148
    down = -0.5 - GRAVITY * impact
    since = np.maximum(time - impact, 0.0)
    height = 0.3 - 0.5 * time - GRAVITY * time**2 / 2 - 1.4 * down * since
    start = State(np.array((0, 0, 0.3)), np.array((0, 0, -0.5)), Rotation.identity(), np.zeros(3))
    assert first_impact(time, height, start, 3e-5) == pytest.approx(impact, abs=1 / 1480)
    assert np.isnan(first_impact(time, height + 1.4 * down * since, start, 3e-5))


@pytest.fixture(scope="module")
def search(measured):
    """Identification with the reference on three tosses, as tracked or as it plays them itself with CELL."""
    table, flown, _ = prepared(*measured)
    real = Identification(COLUMN[0], settings(COLUMN, table.rate), table, flown[::2], flown[1::2], floor=True)
    own = real.motions(load(COLUMN[0]), CELL, flown[::2])
    played = [Flown(one.start, one.drawn, motion, one.impact) for one, motion in zip(flown[::2], own)]
    return {"tracked": real, "played": Identification(*COLUMN[:1], real.settings, table, played, played)}


def test_known_coefficients_are_identified(search):
    """Motions that the engine played itself with e and mu: both are found again, and the errors vanish."""
    found = search["played"].play(load(COLUMN[0]))
    assert found.cell[1] == pytest.approx(CELL[1], rel=0.03)
    assert found.cell[0] == pytest.approx(CELL[0], abs=0.06)
    assert search["played"].distance(load(COLUMN[0]), CELL) < 1e-12
    assert found.distance < 0.03 * CUBE.width


@pytest.mark.slow
def test_identification_agrees_with_a_grid(search):
    """Of 120 cells none fits the tracked tosses better by more than the width of the search's last steps."""
    engine = load(COLUMN[0])
    found = search["tracked"].play(engine)
    grid = product(np.linspace(0, 0.7, 8), np.geomspace(0.08, 0.4, 15))
    distance, cell = min((search["tracked"].distance(engine, cell), cell) for cell in grid)
    assert found.distance < 1.05 * distance
    assert found.cell[1] == pytest.approx(cell[1], rel=0.15)
    assert [own.corners <= one.corners for own, one in zip(found.floor, found.errors)] == [True] * 3


def test_the_command_prints_and_draws(touchstone, tmp_path):
    """A line per engine, the floor and the noise, a picture, a report and a page; before the impact the
    reference is within the noise of tracking."""
    code, out, _ = touchstone("reality tosses", TOSSES, "--engine", "reference", "--out", "found")
    assert code == 0
    assert all(name in out for name in ("reference balanced", "floor", "tracking"))
    assert (tmp_path / "found" / "tosses.png").stat().st_size > 10_000
    report, page = ((tmp_path / "found" / f"report.{kind}").read_text("utf-8") for kind in ("md", "html"))
    assert "## Against measurements" in report
    assert "![Against measurements](tosses.png)" in report
    assert "<h2>Against measurements</h2>" in page
    assert "data:image/png;base64," in page
    assert "Matrix of scenes" not in page
    frame = pd.read_parquet(tmp_path / "found" / "results.parquet")
    rows = frame[frame.metric == "tosses.position"].set_index(["engine", "profile", "subject"]).value
    assert rows["reference", "balanced", "-0.03 s"] < 2 * rows["tracking", "", ""]
    assert rows["reference", "balanced", "0.10 s"] > 10 * rows["tracking", "", ""]
    assert 0.1 < frame[frame.metric == "tosses.mu"].value.item() < 0.3
