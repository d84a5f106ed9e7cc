"""What the hand fits of the records share: which points a run held out, and least squares through a simulation.

    from hand import Run, fit, rk4

A record's own `hand.py` has the equations of the literature and fits them to the points from which Lacuna's search
learned. Needs numpy and scipy.
"""
import csv
import json
import pathlib
import tomllib

import numpy as np
from scipy.optimize import least_squares


def table(path):
    """The columns of a CSV file with one header line, as an array; cells that are no numbers are left out."""
    with open(path) as file:
        rows = [[float(cell) for cell in row] for row in list(csv.reader(file))[1:]]
    return np.array(rows).T


class Run:
    """A finished `lacuna gap` run: the points that it held out, and its figures."""

    def __init__(self, folder):
        self.folder = pathlib.Path(folder)
        self.gap = json.loads((self.folder / "summary.json").read_text())["gap"]
        raw = tomllib.loads((self.folder / "7-gap" / "gap.toml").read_text())
        self.used = np.array(raw["counts"]) > 0

    @property
    def held_out(self):
        """Root mean square errors on the held-out points, without and with what was found."""
        rmse = self.gap["held_out"]["rmse"]
        return rmse["before"], rmse["after"]


def rk4(rate, state, times, most, *arguments):
    """Integrates `rate(t, state, *arguments)` from the first of `times` by steps of at most `most`; returns the states at
    `times`. The states are arrays of which each entry is an integration of its own."""
    state = np.array(state, dtype=float)
    out = [state]
    for a, b in zip(times[:-1], times[1:]):
        n = max(1, int(np.ceil((b - a) / most - 1e-9)))
        h = (b - a) / n
        for i in range(n):
            t = a + i * h
            k1 = rate(t, state, *arguments)
            k2 = rate(t + h / 2, state + h / 2 * k1, *arguments)
            k3 = rate(t + h / 2, state + h / 2 * k2, *arguments)
            k4 = rate(t + h, state + h * k3, *arguments)
            state = state + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        out.append(state)
    return np.array(out)


def fit(simulate, start, data, used=None, scale=None, bounds=None):
    """Least squares: `simulate(P)` has the parameters as rows of `P`, one column for each set of them, and returns one
    column of values for each set. Returns the parameters and all residuals."""
    start = np.array(start, dtype=float)
    scale = np.where(start == 0, 1.0, np.abs(start)) if scale is None else np.array(scale, dtype=float)
    used = np.ones(len(data), bool) if used is None else used
    low, high = (-np.inf, np.inf) if bounds is None else (np.array(b, dtype=float) / scale for b in bounds)
    step = 1e-5

    def residual(z):
        return np.nan_to_num(simulate((z * scale)[:, None])[:, 0] - data, nan=1e6)[used]

    def jacobian(z):
        sets = np.hstack([z[:, None] + step * np.eye(len(z)), z[:, None] - step * np.eye(len(z))]) * scale[:, None]
        y = simulate(sets)[used]
        return np.nan_to_num((y[:, : len(z)] - y[:, len(z):]) / (2 * step))

    found = least_squares(residual, start / scale, jac=jacobian, bounds=(low, high), x_scale="jac", max_nfev=200)
    parameters = found.x * scale
    return parameters, simulate(parameters[:, None])[:, 0] - data


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))
