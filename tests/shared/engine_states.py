"""The states of a scene in an engine, step by step."""

from collections.abc import Iterator

from touchstone.adapters.contract import Engine, Settings, State
from touchstone.scenarios.scenario import Scenario


def states(
    engine: Engine, scenario: Scenario, settings: Settings, steps: int | None = None
) -> Iterator[State]:
    """The state at the start and after each step, always the same object; to the scene's end by default."""
    world, state = engine.build(scenario, settings), State(scenario)
    world.read(state)
    yield state
    for step in range(round(scenario.duration / settings.dt) if steps is None else steps):
        world.drive(step)
        world.step()
        state.clear_contacts()
        world.read(state)
        yield state
    world.close()


def last(engine: Engine, scenario: Scenario, settings: Settings, steps: int | None = None) -> State:
    """The state at the end."""
    for state in states(engine, scenario, settings, steps):
        end = state
    return end
