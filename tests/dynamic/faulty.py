"""Plugins with a fault each, and one without."""

import lacuna
import numpy as np


@lacuna.sampler
class SelfPartner:
    """A walker may draw itself as a partner."""

    walkers: int = 60
    steps: int = 2000

    def step(self, target, state, rng):
        n = len(state.points)
        state.accepted[:] = False
        for walker in range(n):
            first, second = rng.integers(n, size=2)
            length = 2.38 / np.sqrt(2 * state.points.shape[1])
            new = state.points[walker] + length * (state.points[first] - state.points[second])
            density = target.log_density(new)[0]
            if np.log(rng.uniform()) < density - state.log_density[walker]:
                state.points[walker], state.log_density[walker] = new, density
                state.accepted[walker] = True


@lacuna.discrepancy
class IgnoresItsScale:
    """The prediction does not use the scale."""

    scale: float = 0.2

    def unknowns(self, data):
        return []

    def log_likelihood(self, response, data):
        z = (data.values - response[:, None, :]) / self.scale
        return np.nansum(-0.5 * z**2, axis=(1, 2))

    def variance(self, response):
        return {"measurement": np.full(len(response), 0.01)}


@lacuna.discrepancy
class WrongSign:
    """The gradient has the wrong sign."""

    def unknowns(self, data):
        return []

    def log_likelihood(self, response, data):
        z = (data.values - response[:, None, :]) / 0.2
        return np.nansum(-0.5 * z**2, axis=(1, 2))

    def variance(self, response):
        return {"measurement": np.full(len(response), 0.04)}

    def gradient(self, response, data):
        return -np.nansum(data.values - response, axis=0) / 0.04, {}


@lacuna.quantity
class Sound:
    """The largest value."""

    def value(self, curve):
        return curve.max()
