"""The frame budget: its figures in closed form, its order, and its picture."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from touchstone.reports.views.frame_budget import HEADS, budget_part, write_picture
from touchstone.reports.views.pictures import grid, save
from touchstone.reports.views.terminal import budget_parts


@pytest.fixture
def played(lab, recordings):
    """Three scenes of four frames: one with inverse kinematics, one without counts, one of another engine."""
    still = recordings.recording(lab.scene(lab.ground(), lab.ball(), duration=4 / 60))
    reaching = replace(
        still,
        time_frame=np.array([30e-6, 10e-6, 20e-6, 20e-6]),
        stage_names=np.array(["collision", "removal", "drive"]),
        stage_seconds=np.tile([6e-6, 3e-6, 1e-6], (4, 1)),
        work_names=np.array(["posture_qp.solves", "ik.joints", "pairs.contacting"]),
        work=np.array([[0.0, 0.0, 0.0], [8.0, 48.0, 2.0], [3.0, 18.0, 1.0], [1.0, 6.0, 1.0]]),
    )
    bare = replace(
        still,
        time_frame=np.full(4, 5e-6),
        stage_names=np.array(["collision", "removal"]),
        stage_seconds=np.zeros((4, 2)),
    )
    return {
        ("reach", "reference", "balanced"): reaching,
        ("bare", "reference", "balanced"): bare,
        ("reach", "dart", "recommended"): still,
        ("reach", "reference", "paper"): still,
    }


def test_figures_are_those_of_the_recordings(played):
    """The cheaper scene first; shares of all stages, means over frames that have any, and peaks."""
    rows = budget_part(played).rows
    assert "reach, paper" in [row[0] for row in rows]
    first, second = (row for row in rows if "," not in row[0])
    assert first == ["bare", "5.00", "5.00", "0 %", "0 %", "", "", "", "", "", ""]
    # 99th percentile of 10, 20, 20, 30: linear between the last two
    assert second == ["reach", "20.0", "29.7", "60 %", "30 %", "4.0", "8", "24.0", "48", "1.3", "2"]
    assert len(first) == len(HEADS)


def test_the_picture_is_drawn_where_there_is_something_to_draw(played, tmp_path):
    """Write a picture for the reference's scenes, none without any."""
    write_picture({("reach", "dart", "recommended"): played["reach", "dart", "recommended"]}, tmp_path)
    assert list(tmp_path.iterdir()) == []
    write_picture(played, tmp_path)
    (picture,) = tmp_path.iterdir()
    assert picture.name == "frame_budget.png"
    assert picture.read_bytes().startswith(b"\x89PNG")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="the system has no device that is always full")
@pytest.mark.parametrize("kind", ["png", "svg"])
def test_a_full_disk_leaves_no_part_of_a_picture(tmp_path, kind):
    """A picture is written beside its place and renamed: what cannot be written leaves nothing."""
    path = tmp_path / f"chart.{kind}"
    path.with_name(f"{path.name}.part").symlink_to("/dev/full")
    with pytest.raises(OSError, match="No space left on device"):
        save(grid([], 1), path, kind=kind)
    assert list(tmp_path.iterdir()) == []
    save(grid([], 1), path, kind=kind)
    assert list(tmp_path.iterdir()) == [path]


def test_the_table_is_printed_for_several_scenes(played, shown):
    """Print a line a scene; nothing for a single one, whose own table says as much."""
    out = shown(budget_parts(played))
    assert "frame budget" in out
    assert out.index("bare") < out.index("reach")
    only = ("reach", "reference", "balanced")
    assert shown(budget_parts({only: played[only]})) == ""
