"""Scenes written and read again are equal to the bit, and so are their recordings."""

import json
import tomllib
from dataclasses import replace

import numpy as np

from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.files.read import read_scene, scenario_of
from touchstone.scenarios.files.write import scene_data, scene_json, scene_toml
from touchstone.scenarios.scenario import MetricLimit, Scenario


def again(scenario: Scenario, form: str, folder) -> Scenario:
    """The scenario from a file in a format."""
    path = folder / f"scene.{form}"
    path.write_text((scene_json if form == "json" else scene_toml)(scenario), encoding="utf-8")
    return read_scene(path)


def bits(scenario: Scenario) -> str:
    """Text with every digit of a scenario; whole numbers count as floats, as Python compares them."""
    return json.dumps(scene_data(scenario), default=float).replace(".0,", ",").replace(".0]", "]")


def test_every_scene_survives_a_file(tmp_path):
    """Each scene of the catalogue is equal after a file: in value, and in the sign of its zeros."""
    for scenario in catalogue().values():
        own = bits(scenario)
        for form in ("json", "toml"):
            read = again(scenario, form, tmp_path)
            assert read == scenario, (scenario.name, form)
            assert bits(read) == own, (scenario.name, form)


def test_signed_zeros_texts_and_limits_survive(tmp_path):
    """-0.0 stays negative where 0.0 is the default; quotes, controls and own limits stay as they are."""
    scenario = catalogue()["fall"]
    body = replace(scenario.bodies[0], position=(-0.0, 0.0, 0.0))
    odd = 'a "quoted"\n\ttext \x7f \\ with é and \U0001f600'
    limits = (MetricLimit("overlap.max", 1e-3, "seen", engine="bullet"), MetricLimit("work", float("1e22")))
    scenario = replace(scenario, bodies=(body,), summary=odd, limits=limits, tags=())
    for form in ("json", "toml"):
        read = again(scenario, form, tmp_path)
        assert read == scenario
        assert np.copysign(1, read.bodies[0].position[0]) == -1


def test_a_recordings_scene_is_read_again(registry):
    """The JSON text in a recording gives the scenario back, shapes without a type included."""
    recording = registry.played("ball_snip", "reference")
    assert scenario_of(json.loads(recording.scenario)) == catalogue()["ball_snip"]


def test_toml_leaves_defaults_out():
    """A TOML file is short: fields that have their default are absent, arrays of numbers stay on a line."""
    text = scene_toml(catalogue()["fall"], comment="first\nsecond")
    assert text.startswith("# first\n# second\n")
    data = tomllib.loads(text)
    assert "frame_rate" not in data
    assert "orientation" not in data["bodies"][0]
    assert "acceleration = [0.0, 0.0, -9.81]" in text
