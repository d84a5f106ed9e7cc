"""The log posterior in NumPy, for many points at once: Lacuna's coefficients, its priors, its coordinates.

Coordinates are the three parameters and the logarithm of the variance, whose Jacobian the density includes.
`sufficient` uses count, mean and scatter of the curves of each output; `reduced` further replaces the residual of
the mean curve, `mean - C' psi`, by the triangular factor of `[C' mean]`, which has as many rows as terms, and
then omits the directions that are below round-off.
"""

import numpy as np

from common import HIGH, LOW, Basis, array

CURVES = array("curves")
COUNT, MEAN = len(CURVES), CURVES.mean(axis=0)
SCATTER = float(np.sum((CURVES - MEAN) ** 2))


class Posterior:
    """The log density through one of the emulators with one of the two sums of squares."""

    def __init__(self, header, emulator, squares):
        self.coefficients = array(f"{emulator}_coefficients", CURVES.shape[1])
        self.basis = Basis(array(f"{emulator}_exponents", len(LOW)))
        self.squares = {"sufficient": self.sufficient, "reduced": self.reduced}[squares]
        self.scale = header["variance_scale"]
        self.constant = -np.log(HIGH - LOW).sum() + 0.5 * np.log(2.0 / np.pi) - np.log(self.scale)
        triangle = np.linalg.qr(np.column_stack([self.coefficients.T, MEAN]), mode="r")
        _, sizes, directions = np.linalg.svd(triangle, full_matrices=False)
        kept = sizes > 1e-14 * sizes[0]
        self.factor = np.ascontiguousarray((sizes[kept, None] * directions[kept]).T)

    def sufficient(self, points):
        difference = self.basis(points).T @ self.coefficients
        difference -= MEAN
        return np.einsum("ij,ij->i", difference, difference)

    def reduced(self, points):
        psi = self.basis(points)
        extended = np.empty((len(points), len(psi) + 1))
        extended[:, :-1] = psi.T
        extended[:, -1] = -1.0
        difference = extended @ self.factor
        return np.einsum("ij,ij->i", difference, difference)

    def __call__(self, coordinates):
        """Log density at each row."""
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
