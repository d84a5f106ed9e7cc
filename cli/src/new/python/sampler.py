"""`skeleton`: random-walk Metropolis with a step that adapts."""

import lacuna
import numpy as np


@lacuna.sampler("skeleton")
class Skeleton:
    """Random-walk Metropolis whose step follows the covariance of the chains during the warm-up.

    Reference: Haario, Saksman and Tamminen, Bernoulli 7 (2001) 223.
    """

    chains: int = lacuna.option(20, "Number of chains.", minimum=4)
    steps: int = lacuna.option(3000, "Number of steps of each chain, with the warm-up.", minimum=2)
    warm_up: int = lacuna.option(500, "Number of steps in which the step adapts.", minimum=1)

    def start(self, target, state):
        state.memory = {"made": 0, "factor": np.diag(np.ptp(state.points, axis=0) / 4 + 1e-12).tolist()}

    def step(self, target, state, rng):
        memory, dimension = state.memory, state.points.shape[1]
        factor = np.array(memory["factor"]) * 2.38 / np.sqrt(dimension)
        points = state.points + rng.standard_normal(state.points.shape) @ factor.T
        density = target.log_density(points)
        moves = np.log(rng.uniform(size=len(points))) < density - state.log_density
        state.points[moves], state.log_density[moves] = points[moves], density[moves]
        state.accepted[:] = moves
        memory["made"] += 1
        if memory["made"] < self.warm_up and memory["made"] % 50 == 0:
            spread = np.cov(state.points.T).reshape(dimension, dimension)
            memory["factor"] = np.linalg.cholesky(spread + 1e-12 * np.diag(np.diag(spread) + 1e-12)).tolist()
