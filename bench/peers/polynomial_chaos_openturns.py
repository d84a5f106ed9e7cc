"""Sparse expansions by OpenTURNS: least-angle regression and the corrected leave-one-out error, degree 10.

OpenTURNS has no search over degrees; its selection takes Cholesky's decomposition, the fastest of its three. It
shares nothing between outputs, so that a few of them tell the time of all.
"""

import numpy as np
import openturns as ot

from common import HIGH, LOW, array, root_mean_square, timed, write

DEGREE = 10
OUTPUTS = np.array([125, 425, 725])

ot.Log.Show(ot.Log.NONE)
ot.ResourceMap.SetAsString("LeastSquaresMetaModelSelection-DecompositionMethod", "Cholesky")
points, responses = ot.Sample(array("training_points")), array("training_responses")
kept_points, kept_responses = ot.Sample(array("validation_points")), array("validation_responses")
law = ot.JointDistribution([ot.Uniform(low, high) for low, high in zip(LOW, HIGH)])
enumeration = ot.LinearEnumerateFunction(len(LOW))
basis = ot.OrthogonalProductPolynomialFactory([ot.LegendreFactory()] * len(LOW), enumeration)
size = enumeration.getBasisSizeFromTotalDegree(DEGREE)


def fit(output):
    """The expansion of one output."""
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


fits, seconds = timed(lambda: [fit(output) for output in OUTPUTS])
predicted = np.column_stack([np.array(f.getMetaModel()(kept_points))[:, 0] for f in fits])
write(
    "openturns_polynomial_chaos",
    version=ot.__version__,
    outputs=OUTPUTS.tolist(),
    cpu_seconds=seconds,
    cpu_seconds_of_an_output=seconds / len(OUTPUTS),
    terms=[f.getIndices().getSize() for f in fits],
    rmse=root_mean_square(predicted - kept_responses[:, OUTPUTS]).tolist(),
)
