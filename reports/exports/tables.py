"""Recordings as long tables: bodies, hinges and contacts."""

from __future__ import annotations

import numpy as np
import pandas as pd

from touchstone.adapters.recording import Recording
from touchstone.scenarios.scenario import Scenario

AXES, QUATERNION = ("x", "y", "z"), ("qw", "qx", "qy", "qz")


def bodies(recording: Recording, scenario: Scenario) -> pd.DataFrame:
    """A row per frame and body: time [s], position [m] and orientation of the body's frame, velocity of the
    centre of mass [m/s], angular velocity [rad/s]; world."""
    frames, count = recording.position.shape[:2]
    found: dict[str, object] = {
        "frame": np.repeat(np.arange(frames), count),
        "time": np.repeat(recording.time, count),
        "body": [body.name for body in scenario.bodies] * frames,
    }
    for names, values in (
        (AXES, recording.position),
        (QUATERNION, recording.orientation),
        ([f"v{axis}" for axis in AXES], recording.linear_velocity),
        ([f"w{axis}" for axis in AXES], recording.angular_velocity),
    ):
        found |= dict(zip(names, values.reshape(frames * count, -1).T))
    return pd.DataFrame(found)


def joints(recording: Recording, scenario: Scenario) -> pd.DataFrame:
    """A row per frame and hinge: angle [rad] and rate [rad/s]."""
    names = [name for tracker in scenario.trackers for name in tracker.joints]
    frames = len(recording.time)
    return pd.DataFrame(
        {
            "frame": np.repeat(np.arange(frames), len(names)),
            "time": np.repeat(recording.time, len(names)),
            "joint": names * frames,
            "angle": recording.joint_angle.reshape(-1),
            "rate": recording.joint_rate.reshape(-1),
        }
    )


def contacts(recording: Recording, scenario: Scenario) -> pd.DataFrame:
    """A row per contact point of a native step: time [s], bodies, point [m], normal from a to b, distance [m]
    and impulse on b [N s]."""
    names, rows = [body.name for body in scenario.bodies], recording.contacts
    found: dict[str, object] = {
        "time": rows["time"],
        "body_a": [names[k] for k in rows["body_a"]],
        "body_b": [names[k] for k in rows["body_b"]],
        "distance": rows["distance"],
    }
    for start, field in (("", "position"), ("n", "normal"), ("j", "impulse")):
        found |= {f"{start}{axis}": rows[field][:, k] for k, axis in enumerate(AXES)}
    return pd.DataFrame(found)


TABLES = {"bodies": bodies, "joints": joints, "contacts": contacts}
