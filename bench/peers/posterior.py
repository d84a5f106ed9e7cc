"""The log posterior in NumPy, for many points at once: Lacuna's coefficients, its priors, its coordinates.

Coordinates are the three parameters and the logarithm of the variance, whose Jacobian the density carries.
`sufficient` uses count, mean and scatter of the curves of each output; `reduced` further replaces the residual of
the mean curve, `mean - C' psi`, by the triangular factor of `[C' mean]`, which has as many rows as terms.
"""

import numpy as np

from common import HIGH, LOW, Basis, array

CURVES = array("curves")
COUNT, MEAN = len(CURVES), CURVES.mean(axis=0)
SCATTER = float(np.sum((CURVES - MEAN) ** 2))
COEFFICIENTS = array("coefficients", CURVES.shape[1])
BASIS = Basis(array("exponents", len(LOW)))


class Posterior:
    """The log density with one of the two sums of squares."""

    def __init__(self, header, squares):
        self.squares = {"sufficient": self.sufficient, "reduced": self.reduced}[squares]
        self.scale = header["variance_scale"]
        self.constant = -np.log(HIGH - LOW).sum() + 0.5 * np.log(2.0 / np.pi) - np.log(self.scale)
        stacked = np.column_stack([COEFFICIENTS.T, MEAN])
        self.factor = np.ascontiguousarray(np.linalg.qr(stacked, mode="r").T)

    def sufficient(self, points):
        difference = BASIS(points).T @ COEFFICIENTS
        difference -= MEAN
        return np.einsum("ij,ij->i", difference, difference)

    def reduced(self, points):
        psi = BASIS(points)
        extended = np.empty((len(points), len(psi) + 1))
        extended[:, :-1] = psi.T
        extended[:, -1] = -1.0
        difference = extended @ self.factor
        return np.einsum("ij,ij->i", difference, difference)

    def __call__(self, coordinates):
        """The log density at each row."""
        points, logs = coordinates[:, :3], coordinates[:, 3]
        density = np.full(len(points), -np.inf)
        inside = np.all((points >= LOW) & (points <= HIGH), axis=1)
        if not inside.any():
            return density
        logs = logs[inside]
        variance = np.exp(logs)
        squares = SCATTER + COUNT * self.squares(points[inside])
        likelihood = -0.5 * CURVES.size * (np.log(2.0 * np.pi) + logs) - 0.5 * squares / variance
        prior = self.constant - 0.5 * (variance / self.scale) ** 2
        density[inside] = likelihood + prior + logs
        return density
