"""One call that plays a scene on several engines and keeps what each of them did.

    from touchstone.adapters.workers.play import play
    runs = play(scenario, ("reference", "dart", ("reference", "accurate")))
    runs["dart", "recommended"].recording.position

Each engine plays in a child process of its own: one that crashes or hangs is one entry of the answer. A run
that failed keeps what it recorded before.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from touchstone.adapters.contract import MISSING, Settings
from touchstone.adapters.recording import Recording, load
from touchstone.adapters.registry import ENGINES, installed, missing_reason, profiles_of
from touchstone.adapters.workers.children import Children, Job
from touchstone.scenarios.scenario import Scenario


@dataclass(frozen=True, slots=True)
class Run:
    """How an engine played a scene.

    Attributes:
        status: `done`; `skipped`: it cannot represent the scene; `missing`: not installed; `unimportable`:
            installed, but its import fails; `error`: it diverged, left its plan, raised, hung or died.
        reason: one line, but for `done`.
        recording: what it did, until it failed if it did; None where nothing was played or its process died.
    """

    status: str
    reason: str = ""
    recording: Recording | None = None


def play(
    scenario: Scenario,
    engines: Iterable[str | tuple[str, str]] = tuple(ENGINES),
    *,
    dt: float | None = None,
    effects: tuple[str, ...] | None = None,
    children: Children | None = None,
) -> dict[tuple[str, str], Run]:
    """Play a scene on several engines, each in a child process.

    Args:
        engines: names, each with its first profile, or (name, profile).
        dt: native step of all [s], or that of each profile.
        effects: those to run, as in `Settings`; None: those that the scene calls for.
        children: processes to use and to keep, where many scenes are played; or new ones.
    Returns:
        (engine, profile) -> how it went, in the order asked for.
    Raises:
        AdapterError: an engine or a profile is unknown; the message names the valid ones.
    """
    columns = [(one, next(iter(profiles_of(one)))) if isinstance(one, str) else one for one in engines]
    steps = {(name, profile): dt or profiles_of(name, profile)[profile] for name, profile in columns}
    runs = {column: Run(MISSING, missing_reason(column[0])) for column in steps if not installed(column[0])}
    with TemporaryDirectory() as folder:
        jobs = {
            (name, profile): Job(
                name,
                scenario,
                Settings(profile, step, effects=effects),
                Path(folder, f"{name}-{profile}.npz"),
                Path(folder, f"{name}-{profile}.txt"),
            )
            for (name, profile), step in steps.items()
            if (name, profile) not in runs
        }
        if children is None:
            with Children() as own:
                outcomes = own.play(jobs.values(), lambda label, frames: None)
        else:
            outcomes = children.play(jobs.values(), lambda label, frames: None)
        for column, outcome in zip(jobs, outcomes):
            recording = load(outcome.job.recording) if outcome.recorded else None
            runs[column] = Run(outcome.status, outcome.reason, recording)
    return {column: runs[column] for column in steps}
