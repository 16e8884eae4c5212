"""Body pairs by the names of their bodies."""

from touchstone.scenarios.scenario import Scenario


def named_pairs(scenario: Scenario, body: str, other: str) -> list[tuple[int, int]]:
    """Body pairs (a < b) of two names that may touch; a root stands for all links of its driven body."""
    links = {tracker.root: scenario.links(tracker) for tracker in scenario.trackers}
    one, two = (links.get(name, (scenario.body_index(name),)) for name in (body, other))
    wanted = {(min(a, b), max(a, b)) for a in one for b in two}
    return sorted(wanted.intersection(scenario.touching_pairs()))
