"""Code shared by the peers' jobs: the problem that `peers problem` wrote, the clock, the basis, the output.

Every job is called as `python JOB.py FOLDER` and writes `FOLDER/PEER_JOB.json`. Seconds are processor time of
all threads of this process, as on Lacuna's side.
"""

import json
import os
import sys
import time
from pathlib import Path

import numpy as np

FOLDER = Path(sys.argv[1])
HEADER = json.loads((FOLDER / "problem.json").read_text())
LOW, HIGH = np.array(HEADER["ranges"]).T


def array(name, columns=None):
    """Reads an array of the problem; `columns` is needed for arrays that are not in its header."""
    shape = HEADER["shapes"][name] if columns is None else (-1, columns)
    return np.fromfile(FOLDER / f"{name}.f64", "<f8").reshape(shape)


def write(name, **figures):
    """Writes the results of a job with the versions of the packages that made them."""
    figures["load"] = os.getloadavg()[0]
    text = json.dumps(figures, indent=2, default=float)
    (FOLDER / f"{name}.json").write_text(text)
    print(name, {key: value for key, value in figures.items() if np.size(value) == 1})


def timed(call):
    """Result of a call, and its processor time in seconds."""
    begun = time.process_time()
    value = call()
    return value, time.process_time() - begun


def standard(points):
    """Points scaled to [-1, 1]."""
    return (2.0 * points - (LOW + HIGH)) / (HIGH - LOW)


def root_mean_square(residuals):
    """Root mean square of each column."""
    return np.sqrt(np.mean(residuals**2, axis=0))


class Basis:
    """Orthonormal Legendre polynomials: products of one polynomial in each parameter."""

    def __init__(self, exponents):
        self.exponents = np.asarray(exponents, dtype=int)
        self.degree = int(self.exponents.max())
        self.norms = np.sqrt(2.0 * np.arange(self.degree + 1) + 1.0)

    def __call__(self, points):
        """Terms at each point, `terms x points`: whole rows are copied and multiplied."""
        z = standard(points).T
        table = np.empty((self.degree + 1, *z.shape))
        table[0] = 1.0
        table[1] = z
        for n in range(2, self.degree + 1):
            table[n] = ((2 * n - 1) * z * table[n - 1] - (n - 1) * table[n - 2]) / n
        table *= self.norms[:, None, None]
        values = table[self.exponents[:, 0], 0]
        for i in range(1, self.exponents.shape[1]):
            values *= table[self.exponents[:, i], i]
        return values


def total_degree(dimension, degree):
    """All exponents up to a total degree, in order of the degree."""
    grid = np.indices([degree + 1] * dimension).reshape(dimension, -1).T
    sums = grid.sum(axis=1)
    kept = grid[sums <= degree]
    return kept[np.argsort(kept.sum(axis=1), kind="stable")]
