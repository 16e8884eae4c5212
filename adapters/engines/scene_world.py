"""What the worlds of engines share: drives, posed bodies, coefficients of pairs, and the manifest."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from touchstone.adapters.contract import (
    Array,
    BodyFacts,
    Engine,
    Manifest,
    PairFacts,
    Scalar,
    Settings,
    State,
)
from touchstone.adapters.posed_drive import Posed, coupled, posed_of
from touchstone.adapters.servo import Drive, without_ballast
from touchstone.scenarios.scenario import Scenario


class SceneWorld:
    """World of a scene that reports neither times of stages nor counters.

    Attributes:
        _posed: motions of the trackers that no coupling moves, each with its hinges among all hinges.
        _coupled, _trackers, _drives: indices of the other trackers, these, and their drives.
        _moment: steps driven so far.
    """

    def __init__(
        self,
        engine: Engine,
        scenario: Scenario,
        settings: Settings,
        drives: list[Drive] | None = None,
        surfaces: tuple[tuple[Posed, slice], ...] = (),
    ) -> None:
        """`drives`: those of the coupled trackers, where they are known before; `surfaces`: fixed bodies with
        moving surfaces that are posed too."""
        self._engine, self._scenario, self._settings = engine, scenario, settings
        self._posed = posed_of(scenario, settings) + surfaces
        self._coupled = coupled(scenario, settings)
        self._trackers = [scenario.trackers[k] for k in self._coupled]
        self._drives = drives if drives is not None else drives_of(scenario, settings)
        self._moment = 0

    @property
    def _names(self) -> list[str]:
        return [body.name for body in self._scenario.bodies]

    def _posed_links(self) -> dict[int, Posed]:
        return {link: one for one, _ in self._posed for link in one.links}

    def _show_posed(self, state: State) -> None:
        for one, hinges in self._posed:
            one.show(self._moment, state, hinges)

    def _write_hinges(self, state: State, each: Sequence[tuple[Array, Array]]) -> None:
        """Write angles and rates of the hinges of each tracker, in order, into a state."""
        angles, rates = zip(*each)
        state.joint_angle[:], state.joint_rate[:] = np.concatenate(angles), np.concatenate(rates)

    def _pair_facts(self, combined: Callable[[int, int], tuple[float, float]]) -> tuple[PairFacts, ...]:
        """Restitution and friction, by `combined`, of the pairs that may touch."""
        names, pairs = self._names, self._scenario.touching_pairs()
        return tuple(PairFacts(names[a], names[b], *combined(a, b)) for a, b in pairs)

    def _manifest(
        self,
        settings: Mapping[str, Scalar],
        bodies: Mapping[str, BodyFacts],
        pairs: tuple[PairFacts, ...],
        pieces: Sequence[int],
        **others: Any,
    ) -> Manifest:
        """Manifest with the mass properties of bodies less their ballast and the gains of the drives.

        Args:
            pieces: of each body.
            others: further fields.
        """
        fields: dict[str, Any] = {"dt": self._settings.dt, **others}
        return Manifest(
            engine=self._engine.name,
            version=self._engine.version(),
            profile=self._settings.profile,
            settings=settings,
            bodies=without_ballast(bodies, self._scenario, self._drives),
            pairs=pairs,
            drives={tracker.root: drive.gains() for tracker, drive in zip(self._trackers, self._drives)},
            pieces=dict(zip(self._names, pieces)),
            **fields,
        )

    def stage_seconds(self) -> Mapping[str, float]:
        """Nothing: the engine reports none to Python."""
        return {}

    def work(self) -> Mapping[str, float]:
        """Nothing: the engine reports no counters to Python."""
        return {}


def drives_of(scenario: Scenario, settings: Settings) -> list[Drive]:
    """Drives of the coupled trackers of a scene."""
    driven = [scenario.trackers[k] for k in coupled(scenario, settings)]
    return [Drive(scenario, tracker, settings.dt, settings.drive) for tracker in driven]
