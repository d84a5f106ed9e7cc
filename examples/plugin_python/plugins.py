"""Plugins in Python: one of each kind that a file can hold."""

import csv
from pathlib import Path

import lacuna
import numpy as np


@lacuna.model
class Decay:
    """Exponential decay along the last axis: `amplitude * exp(-rate * t)`."""

    def predict(self, inputs, layout):
        curves = inputs["amplitude"][:, None] * np.exp(-inputs["rate"][:, None] * layout.grid)
        return np.repeat(curves, layout.size // len(layout.grid), axis=0).reshape(len(curves), -1)

    def gradient(self, inputs, layout):
        curve = np.exp(-inputs["rate"] * layout.grid)
        copies = layout.size // len(layout.grid)
        slopes = {"amplitude": curve, "rate": -inputs["amplitude"] * layout.grid * curve}
        return {name: np.tile(slopes.get(name, 0 * curve), copies) for name in inputs}


@lacuna.quantity
class Overshoot:
    """Largest excess over a level; zero if there is none."""

    level: float = lacuna.option(0.0, "Level, in the unit of the response.")

    def value(self, curve):
        return max(curve.max() - self.level, 0.0) if not np.isnan(curve).any() else np.nan


@lacuna.effect
class Warming:
    """A zero that drifts with the square of the last axis, equally on all curves."""

    size: dict = lacuna.option({"normal": [0.0, 1.0]}, "Prior of the drift at the end of the axis, in the unit of the response.")

    title, formula, source = "warming of the gauge", "y + size (t / t_end)²", "an example"

    def unknowns(self, layout):
        return [lacuna.unknown("warming", self.size, unit=layout.unit)]

    def apply(self, response, values, layout):
        return response + values["warming"] * (layout.grid / layout.grid[-1]) ** 2


@lacuna.discrepancy
class HeavyTails:
    """Independent errors with Student's t distribution, beside the errors that all replicates share.

    The shared errors (of the emulator, of the mesh) are added to the scale of the mean of the replicates.
    """

    degrees: float = lacuna.option(4.0, "Degrees of freedom.", above=2)
    scale: float = lacuna.option(1.0, "Median of the prior of the scale, in the unit of the response.", above=0)

    def unknowns(self, data):
        prior = {"log_normal": [self.scale, 3.0]}
        return [lacuna.unknown("scale", prior, unit=data.layout.unit, log=True)]

    def prepare(self, data):
        return sum(((factor**2).sum(axis=1) for _, factor in data.common), np.zeros(data.values.shape[1]))

    def log_likelihood(self, response, unknowns, data, prepared):
        shared = data.count * prepared
        square = (unknowns["scale"][:, None] ** 2 + shared)[:, None, :]
        excess = (data.values - response[:, None, :]) ** 2 / (self.degrees * square)
        density = -0.5 * np.log(square) - 0.5 * (self.degrees + 1) * np.log1p(excess)
        return np.nansum(density, axis=(1, 2))

    def variance(self, unknowns):
        return {"measurement": unknowns["scale"] ** 2 * self.degrees / (self.degrees - 2)}

    def simulate(self, response, unknowns, data, rng):
        errors = unknowns["scale"] * rng.standard_t(self.degrees, size=data.values.shape)
        shared = [factor @ rng.standard_normal(factor.shape[1]) for _, factor in data.predictive]
        return response + sum(shared, np.zeros(len(response))) + errors


@lacuna.sampler
class JumpWalk:
    """Many walkers, each of which jumps by the difference between two of the other half.

    Reference: ter Braak, Statistics and Computing 16 (2006) 239.
    """

    walkers: int = lacuna.option(60, "Number of walkers.", minimum=8)
    steps: int = lacuna.option(2000, "Number of steps of each walker.", minimum=1)

    def step(self, target, state, rng):
        state.accepted[:] = False
        order = rng.permutation(len(state.points))
        half = len(order) // 2
        for movers, others in [(order[:half], order[half:]), (order[half:], order[:half])]:
            first = rng.integers(len(others), size=len(movers))
            second = (first + rng.integers(1, len(others), size=len(movers))) % len(others)
            length = 2.38 / np.sqrt(2 * state.points.shape[1]) * (1 + 0.1 * rng.standard_normal((len(movers), 1)))
            new = state.points[movers] + length * (state.points[others[first]] - state.points[others[second]])
            density = target.log_density(new)
            moves = np.log(rng.uniform(size=len(movers))) < density - state.log_density[movers]
            state.points[movers[moves]], state.log_density[movers[moves]] = new[moves], density[moves]
            state.accepted[movers] = moves


@lacuna.surrogate
class Cubic:
    """All polynomials of degree three and less, by least squares."""

    ridge: float = lacuna.option(1e-12, "Penalty beside the mean square of the terms.", minimum=0)

    def fit(self, inputs, outputs):
        return Polynomial(inputs, outputs, self.ridge)


class Polynomial:
    """A polynomial of degree three in inputs of mean zero and variance one."""

    def __init__(self, inputs, outputs, ridge):
        self.centre, self.scale = inputs.mean(axis=0), inputs.std(axis=0)
        terms = self.terms(inputs)
        weights = terms.T @ terms + ridge * len(terms) * np.eye(terms.shape[1])
        self.coefficients = np.linalg.solve(weights, terms.T @ outputs)

    def terms(self, inputs):
        x = np.column_stack([np.ones(len(inputs)), (inputs - self.centre) / self.scale])
        columns = range(x.shape[1])
        return np.column_stack([x[:, i] * x[:, j] * x[:, k] for i in columns for j in columns if j >= i for k in columns if k >= j])

    def predict(self, inputs):
        return self.terms(inputs) @ self.coefficients


@lacuna.reader
class Columns:
    """A table without a header: one column per replicate, one row per value of the response."""

    path: str = lacuna.option(doc="Path of the table, relative to the study.")

    def measurements(self, folder, layout):
        with open(Path(folder) / self.path, newline="") as file:
            rows = [[float(cell) if cell else np.nan for cell in row] for row in csv.reader(file)]
        return np.array(rows).T
