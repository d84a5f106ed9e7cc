"""`skeleton`: independent normal errors of one unknown size."""

import lacuna
import numpy as np


@lacuna.discrepancy("skeleton")
class Skeleton:
    """Independent normal errors of one unknown standard deviation, beside the errors that all replicates share.

    The shared errors (of the emulator, of the mesh) are added to the variance of the mean of the replicates, without their
    correlation between outputs.
    """

    largest: float = lacuna.option(1.0, "Scale of the half-normal prior of the standard deviation, in the unit of the response.", above=0)

    def unknowns(self, data):
        return [lacuna.unknown("skeleton", {"half_normal": self.largest}, unit=data.layout.unit, log=True)]

    def prepare(self, data):
        scatter = np.nansum((data.values - data.mean) ** 2, axis=0)
        shared = sum(((factor**2).sum(axis=1) for _, factor in data.common), np.zeros(data.values.shape[1]))
        return scatter, shared

    def log_likelihood(self, response, unknowns, data, prepared):
        scatter, shared = prepared
        square = unknowns["skeleton"][:, None] ** 2
        measured = data.count > 0
        of_mean = np.where(measured, square / np.maximum(data.count, 1) + shared, 1.0)
        gap = np.where(measured, np.nan_to_num(data.mean) - response, 0.0)
        density = -0.5 * gap**2 / of_mean - 0.5 * np.log(of_mean) * measured
        within = -0.5 * scatter / square - 0.5 * np.maximum(data.count - 1, 0) * np.log(square)
        return (density + within).sum(axis=1)

    def variance(self, unknowns):
        return {"measurement": unknowns["skeleton"] ** 2}

    def simulate(self, response, unknowns, data, rng):
        shared = sum(((factor**2).sum(axis=1) for _, factor in data.predictive), np.zeros(len(response)))
        mean = response + np.sqrt(shared) * rng.standard_normal(len(response))
        return mean + unknowns["skeleton"] * rng.standard_normal(data.values.shape)
