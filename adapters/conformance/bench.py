"""One engine under test: worlds built and stepped by the contract, states copied after each step."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from touchstone.adapters.contract import (
    STATE_FIELDS,
    AdapterError,
    Array,
    Engine,
    Manifest,
    Settings,
    State,
    Unsupported,
    World,
)
from touchstone.scenarios.scenario import Scenario


@dataclass(frozen=True, slots=True)
class Snapshot:
    """Copy of a state: bodies, hinges and the contacts of the last step."""

    position: Array
    orientation: Array
    linear_velocity: Array
    angular_velocity: Array
    joint_angle: Array
    joint_rate: Array
    contacts: NDArray[np.void]

    def equals(self, other: Snapshot) -> bool:
        """Whether both are equal to the bit."""
        same = all(np.array_equal(getattr(self, f), getattr(other, f)) for f in STATE_FIELDS)
        return same and np.array_equal(self.contacts["impulse"], other.contacts["impulse"])


class ContractError(AdapterError):
    """The adapter breaks the contract in a way that ends a check; the message is the finding."""


class Bench:
    """An engine with a profile; `play` steps a scene."""

    def __init__(self, engine: Engine, settings: Settings) -> None:
        self.engine, self.settings = engine, settings
        self.dt = settings.dt
        self.unsupported: list[str] = []

    def each(self, scenarios: Iterable[Scenario], one: Callable[[Scenario], Iterable[str]]) -> Iterator[str]:
        """Faults that `one` finds in each scenario; those that the engine refuses are kept in
        `unsupported`."""
        for scenario in scenarios:
            try:
                yield from one(scenario)
            except Unsupported as error:
                self.unsupported.append(str(error))

    @contextmanager
    def world(self, scenario: Scenario) -> Iterator[World]:
        """A world that is closed at the end; raises ContractError if it lacks a method."""
        world = self.engine.build(scenario, self.settings)
        contract = (name for name, one in vars(World).items() if callable(one) and not name.startswith("_"))
        if lacking := [name for name in contract if not callable(getattr(world, name, None))]:
            raise ContractError(f"`build` returns {type(world).__name__}, which lacks {', '.join(lacking)}")
        try:
            yield world
        finally:
            world.close()

    def play(self, scenario: Scenario, steps: int, reads: int = 1) -> list[Snapshot]:
        """States after 0 to `steps` steps, each read `reads` times."""
        with self.world(scenario) as world:
            seen = [self.read(world, scenario, reads)]
            for step in range(steps):
                world.drive(step)
                world.step()
                seen.append(self.read(world, scenario, reads))
        return seen

    def read(self, world: World, scenario: Scenario, reads: int = 1) -> Snapshot:
        """The state as the world writes it into new arrays; raises ContractError if it replaces them."""
        state = State(scenario)
        for _ in range(reads):
            arrays = {name: getattr(state, name) for name in (*STATE_FIELDS, "contacts")}
            shapes = {name: array.shape for name, array in arrays.items()}
            state.clear_contacts()
            world.read(state)
            for name, array in arrays.items():
                found = getattr(state, name)
                write = f"write into it (state.{name}[:] = ...)"
                if np.shape(found) != shapes[name]:
                    wrong = f"by one of shape {np.shape(found)}, expected {shapes[name]}"
                    raise ContractError(f"`read` replaces state.{name} {wrong}; {write}")
                if found is not array:
                    raise ContractError(f"`read` replaces state.{name}; {write}")
        copies = {name: getattr(state, name).copy() for name in STATE_FIELDS}
        return Snapshot(**copies, contacts=state.contacts[: state.contact_count].copy())

    def manifest(self, scenario: Scenario) -> Manifest:
        """What a world says of itself."""
        with self.world(scenario) as world:
            return world.describe()
