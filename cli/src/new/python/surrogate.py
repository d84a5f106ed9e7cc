"""`skeleton`: cubic polynomials by least squares."""

import lacuna
import numpy as np


@lacuna.surrogate("skeleton")
class Skeleton:
    """All polynomials of degree three and less in the inputs, by least squares.

    Regressors in the manner of scikit-learn need one line instead: `lacuna.surrogate(RandomForestRegressor, name="forest")`.
    """

    ridge: float = lacuna.option(1e-12, "Penalty beside the mean square of the terms.", minimum=0)

    def fit(self, inputs, outputs):
        return Cubic(inputs, outputs, self.ridge)


class Cubic:
    """A fitted polynomial; it can be pickled, and has the method `predict`."""

    def __init__(self, inputs, outputs, ridge):
        self.centre, self.scale = inputs.mean(axis=0), np.maximum(inputs.std(axis=0), 1e-300)
        terms = self.terms(inputs)
        weights = terms.T @ terms + ridge * len(terms) * np.eye(terms.shape[1])
        self.coefficients = np.linalg.solve(weights, terms.T @ outputs)

    def terms(self, inputs):
        x = np.column_stack([np.ones(len(inputs)), (inputs - self.centre) / self.scale])
        columns = range(x.shape[1])
        places = [(i, j, k) for i in columns for j in columns if j >= i for k in columns if k >= j]
        return np.column_stack([x[:, i] * x[:, j] * x[:, k] for i, j, k in places])

    def predict(self, inputs):
        return self.terms(inputs) @ self.coefficients
