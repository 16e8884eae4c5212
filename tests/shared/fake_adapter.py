"""Adapter of a made-up engine whose distribution the tests build: `fake_physics.FACTOR` scales gravity."""

import fake_physics

from touchstone.adapters.engines.simple_world import SimpleWorld


class Engine:
    """Engine without contacts."""

    name = "faked"
    profiles = {"default": 1 / 240}  # noqa: RUF012

    def build(self, scenario, settings):
        """World of a scenario."""
        return World(scenario, settings)

    def version(self):
        """Version of the imported library."""
        return fake_physics.VERSION


class World(SimpleWorld):
    """Bodies that fall."""

    engine, version = "faked", fake_physics.VERSION

    def step(self):
        """Fall by one step."""
        self.linear_velocity[self.free] += fake_physics.FACTOR * self.gravity * self.dt
        self.advance()
