"""Sparse expansions by OpenTURNS: least-angle regression and the corrected leave-one-out error.

OpenTURNS has no search over degrees. Degree 10 is fitted with the decomposition it takes by default (SVD) and with
Cholesky's, the fastest of its three; degree 20 with Cholesky's. It shares nothing between outputs, so that the
time of all follows from that of a few.
"""

import numpy as np
import openturns as ot

from common import HIGH, LOW, array, root_mean_square, timed, write

# Name, degree, decomposition, outputs.
CASES = [
    ("default", 10, "SVD", [125, 425, 725]),
    ("cholesky", 10, "Cholesky", [125, 425, 725]),
    ("cholesky_20", 20, "Cholesky", [425]),
]

ot.Log.Show(ot.Log.NONE)
points, responses = ot.Sample(array("training_points")), array("training_responses")
kept_points, kept_responses = ot.Sample(array("validation_points")), array("validation_responses")
law = ot.JointDistribution([ot.Uniform(low, high) for low, high in zip(LOW, HIGH)])
enumeration = ot.LinearEnumerateFunction(len(LOW))
basis = ot.OrthogonalProductPolynomialFactory([ot.LegendreFactory()] * len(LOW), enumeration)


def fit(output, size):
    """Expansion of one output, selected from the given number of terms."""
    selection = ot.LeastSquaresMetaModelSelectionFactory(ot.LARS(), ot.CorrectedLeaveOneOut())
    algorithm = ot.FunctionalChaosAlgorithm(
        points,
        ot.Sample(responses[:, [output]]),
        law,
        ot.FixedStrategy(basis, size),
        ot.LeastSquaresStrategy(selection),
    )
    algorithm.run()
    return algorithm.getResult()


def case(degree, decomposition, outputs):
    """Results of one fitting method."""
    ot.ResourceMap.SetAsString("LeastSquaresMetaModelSelection-DecompositionMethod", decomposition)
    size = enumeration.getBasisSizeFromTotalDegree(degree)
    fits, seconds = timed(lambda: [fit(output, size) for output in outputs])
    predicted = np.column_stack([np.array(f.getMetaModel()(kept_points))[:, 0] for f in fits])
    return {
        "outputs": outputs,
        "cpu_seconds_of_an_output": seconds / len(outputs),
        "terms": [f.getIndices().getSize() for f in fits],
        "rmse": root_mean_square(predicted - kept_responses[:, outputs]).tolist(),
    }


figures = {name: case(*settings) for name, *settings in CASES}
write("openturns_polynomial_chaos", version=ot.__version__, **figures)
