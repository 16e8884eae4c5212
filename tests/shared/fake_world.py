"""World of a fake engine: what all fakes have in common."""

from touchstone.adapters.contract import Manifest, Unsupported


class FakeWorld:
    """Counts steps; a fake defines what its bodies do in `read`, and what goes wrong in `step`."""

    def __init__(self, fake, scenario, settings):
        self.fake, self.scenario, self.settings, self.steps = fake, scenario, settings, 0

    def drive(self, step):
        """Nothing is driven."""

    def step(self):
        """Count a step."""
        self.steps += 1

    def read(self, state):
        """Nothing moves."""

    def work(self):
        """Nothing is left unresolved."""
        return {}

    def describe(self):
        """Manifest without bodies."""
        name = self.fake if isinstance(self.fake, str) else "fake"
        return Manifest(name, "1", self.settings.profile, self.settings.dt, {}, {}, ())

    def stage_seconds(self):
        """No stages are timed."""
        return {}

    def cross(self):
        """Make an empty call."""

    def close(self):
        """Free nothing."""


class FakeEngine:
    """Builds worlds that do what its name says; "unsupported" builds none."""

    def __init__(self, name="", world=FakeWorld):
        self.name, self.world = name, world

    def build(self, scenario, settings):
        """World of a scenario."""
        if self.name == "unsupported":
            raise Unsupported("unsupported: no shapes")
        return self.world(self.name, scenario, settings)
