"""The study convergence: orders, floors and errors that are known beforehand."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

from touchstone.adapters.registry import installed
from touchstone.reports.results import COLUMNS, Row, table
from touchstone.reports.studies.convergence.measure import ERROR, at_frame_rate, error_of
from touchstone.reports.studies.convergence.study import (
    EXACT,
    FLOOR,
    NEARER,
    ORDER,
    STEPS,
    STUDY,
    cells,
    draw,
    findings,
    order_of,
    own_step,
    report,
    run,
    scenes,
)
from touchstone.reports.studies.study import RefusedError
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.closed_form import motion

H = np.array(STEPS)


@pytest.mark.parametrize("order", [0.5, 1.0, 2.0, 4.0])
@pytest.mark.parametrize("floor", [0.0, 1e-9])
def test_a_power_law_gives_its_exponent(order: float, floor: float) -> None:
    """The slope of a power law, with a narrow interval; a floor below it is found and not fitted."""
    found = order_of(STEPS, 3.0 * H**order + floor)
    assert found.kind == "order"
    assert found.value == pytest.approx(order, rel=1e-12 if floor == 0 else 0.15)
    assert found.low <= found.value <= found.high
    assert found.floor == pytest.approx(3.0 * H[-1] ** order + floor)


def test_scatter_widens_the_interval() -> None:
    """The interval of 95 % covers the exponent in 95 of 100 draws of noisy errors, give or take four."""
    rng = np.random.default_rng(7)
    draws = [order_of(STEPS, H**2 * np.exp(rng.normal(0, 0.3, len(H)))) for _ in range(1000)]
    covered = [found.low <= 2 <= found.high for found in draws]
    assert 0.91 < np.mean(covered) < 0.99


def test_what_has_no_order() -> None:
    """Rounding is exact, an error of the model is flat, and one step above the floor is too few."""
    assert order_of(STEPS, np.full(7, EXACT / 2)).kind == "exact"
    flat = order_of(STEPS, np.linspace(0.2, 0.1, 7))
    assert (flat.kind, flat.falls) == ("flat", False)
    assert order_of(STEPS, [1.0, *[1e-3] * 6]).kind == "few"
    assert np.isnan(flat.value)
    # whether the two finest steps still lower the error
    assert order_of(STEPS, H).falls
    assert not order_of(STEPS, H + 0.1).falls
    assert not order_of(STEPS, H**4).falls  # below EXACT


def test_the_error_of_a_body_is_its_shift_and_its_turn(recordings: SimpleNamespace) -> None:
    """A run that is off by a known way and a known angle has the error that follows from both."""
    scene = at_frame_rate("fall", 0)
    body, truth = scene.bodies[0], scene.truths[0]
    still = recordings.recording(scene)
    m = motion(scene, truth, still.time)
    position, orientation = m.position[:, None] + [0.0, 0.0, 0.03], m.orientation[:, None].copy()
    exact = recordings.recording(scene, position=m.position[:, None], orientation=orientation)
    assert error_of(exact, scene) < 1e-14
    turned = Rotation.from_rotvec([0.1, 0.0, 0.0]) * Rotation.from_quat(m.orientation[-1], scalar_first=True)
    orientation[-1, 0] = turned.as_quat(scalar_first=True)
    radius = np.sqrt(np.trace(body.inertia) / 2 / body.mass)
    fallen = np.linalg.norm(m.position[-1] - m.position[0])
    off = recordings.recording(scene, position=position, orientation=orientation)
    assert error_of(off, scene) == pytest.approx(np.hypot(0.03, 0.1 * radius) / fallen, rel=1e-9)


def test_scenes_are_cut_to_whole_frames() -> None:
    """All default scenes have a truth and play at 30 frames per second."""
    for name in scenes():
        scene = at_frame_rate(name, 0)
        assert scene.truths
        assert catalogue()[name].duration - 1 / 30 < scene.duration <= catalogue()[name].duration
    with pytest.raises(RefusedError, match=r"no truth for ball_snip; valid: .*fall"):
        cells(["ball_snip"], ["reference"])


def forged(errors: dict[tuple[str, str], np.ndarray]) -> pd.DataFrame:
    """The table of a scene in which engines have given errors at STEPS, the last one at the own step too."""
    rows = [
        Row(STUDY, "hill", engine, profile, dt, ERROR, float(error), "1")
        for (engine, profile), values in errors.items()
        for dt, error in ({own_step(engine, profile): values[-1]} | dict(zip(STEPS, values))).items()
    ]
    frame = table(rows)
    return pd.concat([frame, table(findings(frame))], ignore_index=True)


ERRORS = {
    ("reference", "balanced"): H**2,
    ("reference", "accurate"): H**2 / 10,
    ("dart", "recommended"): np.where(H > 1 / 100, H**2 / 5, H),
    ("mujoco", "recommended"): np.full(7, 0.3),
}


def test_who_is_nearer_to_the_truth() -> None:
    """One row for each step and profile at which an engine is nearer than the reference, with the factor."""
    frame = forged(ERRORS)
    near = frame[frame.metric == NEARER]
    assert list(near.subject.unique()) == ["dart"]
    assert list(near.profile.unique()) == ["balanced"]
    assert set(near.dt) == {1 / 30, 1 / 60}
    np.testing.assert_allclose(near.value, 5.0)


def test_the_table_shows_order_floor_and_who_is_nearer(shown, tmp_path: Path) -> None:
    """Orders, floors and the mark are printed, and a run that ended early with its reason."""
    ended = Row(STUDY, "hill", "bullet", "recommended", 1 / 30, "run", verdict="skipped", reason="no hills")
    frame = pd.concat([forged(ERRORS), table([ended])], ignore_index=True)
    lines = {line[1:20].strip(): line for line in shown(report(frame), 120).splitlines()[::-1]}
    assert "2.00 (2.00 to 2.00)" in lines["reference balanced"]
    assert "! 2 of 7, 5.00" in lines["dart recommended"]
    assert "flat" in lines["mujoco recommended"]
    assert "skipped: hill: no hills (bullet at 1/30 s)" in shown(report(frame), 120)
    for part in (frame, frame[:0]):
        draw(part, tmp_path / "drawn.png")
        assert (tmp_path / "drawn.png").read_bytes().startswith(b"\x89PNG")


def test_known_orders(tmp_path: Path) -> None:
    """Free fall: the reference is exact; semi-implicit Euler of DART, Bullet and MuJoCo has order 1."""
    engines = [engine for engine in ("reference", "dart", "bullet", "mujoco") if installed(engine)]
    frame = run(cells(["fall"], engines), tmp_path / "store", tmp_path / "out", jobs=1)
    assert tuple(frame.columns) == COLUMNS
    orders = frame[frame.metric == ORDER].set_index("engine")
    assert set(orders.loc["reference"].reason_code) == {"exact"}
    for engine in engines[1:]:
        assert orders.loc[engine].value == pytest.approx(1.0, abs=0.02)
        floor = frame[(frame.metric == FLOOR) & (frame.engine == engine)]
        assert floor.reason.to_list() == ["still falls"]
    assert (tmp_path / "out" / "convergence.png").exists()
