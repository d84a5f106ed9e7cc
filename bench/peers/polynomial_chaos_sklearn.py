"""Adaptive sparse expansions by scikit-learn's `lars_path` and leave-one-out errors from an incremental QR.

Least-angle regression ranks the terms of a degree, at most 220 of them; each set of first terms is fitted by
least squares and judged by its leave-one-out error times the factor of Chapelle, Vapnik and Bengio (2002),
`N / (N - P) (1 + tr (Psi' Psi)^-1)`. An output is done when two degrees in a row were worse than its best one.
The QR grows by one column per term (Gram-Schmidt, done twice), so that a whole path costs one factorisation.
Every fiftieth output is fitted; the bases of all degrees are computed beforehand and not timed.
"""

import numpy as np
import sklearn
from sklearn.linear_model import lars_path

from common import Basis, array, root_mean_square, timed, total_degree, write

STEPS = 220
DEGREES = 20
OUTPUTS = np.arange(25, 1000, 50)

points, responses = array("training_points"), array("training_responses")
kept_points, kept_responses = array("validation_points"), array("validation_responses")
basis = Basis(total_degree(3, DEGREES))
design, kept_design = basis(points).T, basis(kept_points).T
counts = [int(np.sum(basis.exponents.sum(axis=1) <= p)) for p in range(DEGREES + 1)]
runs = len(points)


def standardised(columns):
    """Columns shifted to mean zero and scaled to length one."""
    centred = columns - columns.mean(axis=0)
    return centred / np.linalg.norm(centred, axis=0)


REGRESSORS = np.asfortranarray(standardised(design[:, 1:]))


def path_errors(order, y):
    """Corrected leave-one-out error of each leading set of terms."""
    q = np.empty((runs, len(order)), order="F")
    inverse = np.zeros((len(order), len(order)))
    residual, leverage, trace = y.copy(), np.zeros(runs), 0.0
    errors = np.empty(len(order))
    for k, term in enumerate(order):
        column = design[:, term].copy()
        r = q[:, :k].T @ column
        column -= q[:, :k] @ r
        again = q[:, :k].T @ column
        column -= q[:, :k] @ again
        r += again
        length = np.linalg.norm(column)
        if length < 1e-10 or k + 2 >= runs:
            return errors[:k]
        q[:, k] = column / length
        inverse[:k, k] = -(inverse[:k, :k] @ r) / length
        inverse[k, k] = 1.0 / length
        trace += inverse[: k + 1, k] @ inverse[: k + 1, k]
        residual -= q[:, k] * (q[:, k] @ residual)
        leverage += q[:, k] ** 2
        terms = k + 1
        factor = runs / (runs - terms) * (1.0 + trace)
        errors[k] = factor * np.mean((residual / (1.0 - leverage)) ** 2)
    return errors


def fit_degree(y, degree):
    """The best set of terms of a degree, and its error relative to the variance."""
    regressors = REGRESSORS[:, : counts[degree] - 1]
    centred = y - y.mean()
    steps = min(STEPS, regressors.shape[1])
    _, active, _ = lars_path(regressors, centred, max_iter=steps, return_path=False)
    order = [0, *(np.asarray(active) + 1)]
    errors = path_errors(order, y) / y.var()
    best = int(np.argmin(errors))
    return order[: best + 1], errors[best]


def fit(y):
    """The best set of terms of all degrees, their coefficients and their error."""
    best, least, worse = None, np.inf, 0
    for degree in range(1, DEGREES + 1):
        terms, error = fit_degree(y, degree)
        if error < least:
            best, least, worse = terms, error, 0
        else:
            worse += 1
        if worse == 2 and least < 0.5:
            break
    coefficients = np.linalg.lstsq(design[:, best], y, rcond=None)[0]
    return best, coefficients, least


def fit_all():
    return [fit(responses[:, output]) for output in OUTPUTS]


def fit_all_of_ten():
    return [fit_degree(responses[:, output], 10) for output in OUTPUTS]


fits, seconds = timed(fit_all)
_, seconds_of_ten = timed(fit_all_of_ten)
predicted = np.column_stack([kept_design[:, terms] @ c for terms, c, _ in fits])
write(
    "sklearn_polynomial_chaos",
    version=sklearn.__version__,
    outputs=OUTPUTS.tolist(),
    cpu_seconds=seconds,
    cpu_seconds_of_an_output=seconds / len(OUTPUTS),
    cpu_seconds_of_an_output_of_degree_10=seconds_of_ten / len(OUTPUTS),
    loo=[error for _, _, error in fits],
    terms=[len(terms) for terms, _, _ in fits],
    rmse=root_mean_square(predicted - kept_responses[:, OUTPUTS]).tolist(),
)
