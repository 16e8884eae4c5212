"""The model card: all engines hold the same driven bodies, and one that does not is found out."""

import json
from dataclasses import replace

import numpy as np
import pytest

from touchstone.adapters.recorder import record
from touchstone.adapters.registry import ENGINES
from touchstone.reports.views.model_card import AGREED, NotDriven, card_rows, deviation
from touchstone.scenarios.catalogue import catalogue

SCENES = ("ball_snip", "wall_push", "arms_cross")


def one_frame(scene: str):
    """A scene cut to a frame."""
    scenario = catalogue()[scene]
    return replace(scenario, duration=1 / scenario.frame_rate, expectations=())


@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("name", ENGINES)
def test_every_engine_holds_what_the_referee_does(name: str, scene: str, registry) -> None:
    """Agree in mass, centre, inertia, limits, degrees of freedom and pieces to 1e-9."""
    scenario = one_frame(scene)
    recording = record(registry.engine(name), scenario, registry.settings(name))
    assert deviation(scenario, scenario.trackers[0], recording) <= AGREED


@pytest.mark.parametrize("change", ["mass", "inertia", "limits", "pieces", "freedom"])
def test_what_differs_is_found(change: str, registry) -> None:
    """Tell a millionth of mass, inertia or a limit, and one piece or degree of freedom more."""
    scenario = one_frame("wall_push")
    recording = record(registry.engine("reference"), scenario, registry.settings("reference"))
    facts = recording.facts
    match change:
        case "mass":
            facts["bodies"]["head"]["mass"] *= 1 + 1e-6
        case "inertia":
            inertia = np.array(facts["bodies"]["torso"]["inertia"])
            facts["bodies"]["torso"]["inertia"] = (inertia * (1 + 1e-6)).tolist()
        case "limits":
            facts["limits"]["left_knee"][1] += 1e-6
        case "pieces":
            facts["pieces"]["left_foot"] += 1
        case _:
            facts["freedom"] += 1
    reported = replace(recording, manifest=json.dumps(facts))
    assert deviation(scenario, scenario.trackers[0], reported) > AGREED


def test_a_scene_without_driven_bodies_has_no_card() -> None:
    """Say so in a line."""
    with pytest.raises(NotDriven, match="fall: no driven bodies"):
        card_rows(catalogue()["fall"])
