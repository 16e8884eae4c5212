"""Play a scene on several engines and return their recordings.

    from touchstone.adapters.workers.play import play
    runs = play(scenario, ("reference", "dart", ("reference", "accurate")))
    runs["dart", "recommended"].recording.position

Each engine plays in its own child process, so a crash or a hang affects one entry of the result only. A run
that failed keeps its recording up to the failure.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from touchstone.adapters.contract import MISSING, Settings
from touchstone.adapters.recording import Recording, load
from touchstone.adapters.registry import ENGINES, installed, missing_reason, profiles_of, registered
from touchstone.adapters.workers.children import Children, Job
from touchstone.adapters.workers.scratch import scratch_folder
from touchstone.scenarios.scenario import Scenario


@dataclass(frozen=True, slots=True)
class Run:
    """Result of a scene on one engine.

    Attributes:
        status: `done`; `skipped`: the engine cannot represent the scene; `missing`: not installed;
            `unimportable`: installed, but its import fails; `error`: it diverged, violated its plan, raised,
            hung or died.
        reason: one line; empty if `done`.
        recording: up to the failure if the run failed; None if nothing was played or the process died.
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
        engines: names, or "module:Class", each with its first profile, or (name, profile).
        dt: native step for all engines [s]; None: that of each profile.
        effects: effects to run, as in `Settings`; None: those that the scene requires.
        children: processes to reuse when many scenes are played; None: new ones.
    Returns:
        (engine, profile) -> result, in the order of `engines`.
    Raises:
        AdapterError: an engine or a profile is unknown; the message names the valid ones.
    """
    pairs = [(one, "") if isinstance(one, str) else one for one in engines]
    named = [(registered(name), profile) for name, profile in pairs]
    columns = [(name, profile or next(iter(profiles_of(name)))) for name, profile in named]
    steps = {(name, profile): dt or profiles_of(name, profile)[profile] for name, profile in columns}
    runs = {column: Run(MISSING, missing_reason(column[0])) for column in steps if not installed(column[0])}
    with scratch_folder() as folder:
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
