"""The table of the reference's settings: every row reaches the state, and comes back from it by name."""

import numpy as np
import pytest

from touchstone.adapters.contract import Settings
from touchstone.adapters.engines.reference.engine import ReferenceEngine
from touchstone.adapters.engines.reference.settings import (
    COLUMNS,
    EQUAL,
    PAPER,
    PROFILES,
    SETTINGS,
    configure,
    describe,
)
from touchstone.adapters.knobs import Choice, SettingError
from touchstone.adapters.registry import ENGINES
from touchstone.reference_impl.core.state_dtype import STATE


def test_every_profile_is_a_column() -> None:
    """Set in the table what the registry promises, and nothing else."""
    assert set(SETTINGS.profiles) == set(ENGINES["reference"].profiles) == {*PROFILES, EQUAL}
    assert SETTINGS.values_of("equal-step") == SETTINGS.values_of("balanced")
    assert all(len(setting.profiles) == len(SETTINGS.profiles) - 1 for setting in SETTINGS.values())


@pytest.mark.parametrize("profile", [*COLUMNS, EQUAL])
def test_a_profile_is_read_back_as_it_was_set(profile: str) -> None:
    """Write a profile over a state full of other numbers; the same words come back."""
    state = np.zeros(1, STATE)
    for setting in SETTINGS.values():
        state[setting.name] = -1
    configure(state[0], profile)
    reported = {name: str(value) for name, value in describe(state[0]).items()}
    column = SETTINGS.profiles.index(profile)
    assert reported == {name: s.profiles[column] for name, s in SETTINGS.items()}
    assert SETTINGS.values_of(profile) == reported


@pytest.mark.parametrize(
    ("name", "value"), [(s.name, v) for s in SETTINGS.values() if isinstance(s, Choice) for v in s.values]
)
def test_a_change_changes_its_own_setting_alone(name: str, value: str) -> None:
    """Reach each named value of each setting from every profile, and leave all others alone."""
    for profile in COLUMNS:
        plain, state = np.zeros(1, STATE), np.zeros(1, STATE)
        configure(plain[0], profile)
        configure(state[0], profile, SETTINGS.changes(profile, [f" {name} = {value}"]))
        assert describe(state[0]) == {**describe(plain[0]), name: value}


def test_changes_have_one_spelling() -> None:
    """Drop what the profile sets anyway; order by the table, and write numbers the one way."""
    wanted = ["event_rows=1e3", "depth=exact", "removal=least_motion", "depth=exact"]
    assert SETTINGS.changes("balanced", wanted) == ("removal=least_motion", "depth=exact", "event_rows=1000")
    assert SETTINGS.changes("accurate", wanted) == ("depth=exact", "event_rows=1000")
    assert SETTINGS.changes("accurate", ["event_rows=16384.0"]) == ()
    assert Settings("balanced", 1 / 60, ("depth=exact",)).label == "balanced, depth=exact"


def test_paper_has_the_numbers_of_the_scene_alone(lab) -> None:
    """Refuse every setting under `paper` with what it has instead, and name its constants in the manifest."""
    for text in ("depth=exact", "friction=stick"):
        with pytest.raises(
            SettingError, match=r"profile paper has no such setting: .* K \(stiffness\) and R"
        ):
            SETTINGS.changes(PAPER, [text])
    assert SETTINGS.changes(PAPER, []) == ()
    assert SETTINGS.values_of(PAPER) == {}
    manifest = ReferenceEngine().build(lab.scene(lab.ball()), Settings(PAPER, 1 / 60)).describe()
    assert "depth" not in manifest.settings
    assert manifest.settings["attraction time"] == 0.1
