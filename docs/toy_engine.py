"""A toy engine in 40 lines: balls over a floor, one impulse for each contact and step."""

import numpy as np

import touchstone as ts


class ToyEngine:
    name, profiles = "toy", {"default": 1 / 240}

    def version(self):
        return "1.0"

    def build(self, scenario, settings):
        for body in scenario.bodies:
            kind = {"simulated": ts.Sphere, "fixed": ts.Box}.get(body.kind)
            if kind is None or [type(piece.shape) for piece in body.pieces] not in ([], [kind]):
                raise ts.Unsupported(f"toy: {body.name!r} is neither a ball nor a fixed box")
        return ToyWorld(scenario, settings)


class ToyWorld(ts.SimpleWorld):
    engine, version = "toy", "1.0"

    def step(self):
        v, w = self.linear_velocity, self.angular_velocity
        v[self.free] += self.gravity * self.dt
        for a, b in self.pairs:
            shapes = [self.scenario.bodies[k].pieces[0].shape for k in (a, b)]
            size = [s.radius if isinstance(s, ts.Sphere) else s.half_extents[2] for s in shapes]
            apart = self.position[b] - self.position[a]
            apart[:2] *= self.free[a] and self.free[b]  # a floor is a half space
            distance, n = np.linalg.norm(apart) - sum(size), apart / np.linalg.norm(apart)
            meeting = v[b] - v[a] - np.cross(size[1] * w[b] + size[0] * w[a], n)
            approach = -meeting @ n
            if distance < 0 < approach:
                mass, slip = 1 / self.inverse_mass[[a, b]].sum(), meeting + approach * n
                press = (1 + self.restitution[a, b] * (approach > 0.1)) * approach * mass
                stick = 2 / 7 * mass * np.linalg.norm(slip)  # of solid balls
                hold = min(1.0, self.friction[a, b] * press / max(stick, 1e-300)) * 2 / 7 * mass
                point = self.position[b] - (size[1] + distance / 2) * n
                self.push(a, b, point, n, distance, press * n - hold * slip)
        self.advance()
