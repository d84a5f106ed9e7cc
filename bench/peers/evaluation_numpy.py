"""The expansion of all outputs at many points by NumPy: its basis and one dense product for each piece.

The values at the first points are compared with Lacuna's, relative to the largest.
"""

import numpy as np

from common import Basis, array, timed, write

points = array("evaluation_points", 3)
theirs = array("evaluation_values", 1000)
coefficients = array("coefficients", 1000)
basis = Basis(array("exponents", 3))


def evaluate(size):
    for start in range(0, len(points), size):
        basis(points[start : start + size]).T @ coefficients


ours = basis(points[: len(theirs)]).T @ coefficients
write(
    "numpy_evaluation",
    version=np.__version__,
    points=len(points),
    cpu_seconds_by_chunk={str(size): timed(lambda: evaluate(size))[1] for size in [256, 2048]},
    difference=np.abs(ours - theirs).max() / np.abs(theirs).max(),
)
