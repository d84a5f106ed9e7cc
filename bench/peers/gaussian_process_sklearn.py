"""Gaussian processes by scikit-learn: Matern 5/2 with a length scale for each parameter, a variance and a noise.

Each output has hyperparameters of its own, found by one run of L-BFGS-B from length scales of half the range,
which is its default; responses are standardised.
"""

import json
import warnings

import numpy as np
import sklearn
from sklearn.exceptions import ConvergenceWarning
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import ConstantKernel, Matern, WhiteKernel

from common import FOLDER, array, root_mean_square, standard, timed, write

warnings.simplefilter("ignore", ConvergenceWarning)
outputs = json.loads((FOLDER / "lacuna_gaussian_process.json").read_text())["outputs"]
points, kept = standard(array("training_points")), standard(array("validation_points"))
responses, truth = array("training_responses"), array("validation_responses")


def fit(output):
    kernel = ConstantKernel(10.0, (1e-3, 1e6)) * Matern([1.0] * 3, (1e-2, 1e3), nu=2.5)
    kernel += WhiteKernel(1e-6, (1e-12, 1.0))
    process = GaussianProcessRegressor(kernel, normalize_y=True, alpha=1e-10)
    return process.fit(points, responses[:, output])


fits, seconds = timed(lambda: [fit(output) for output in outputs])
predicted = np.column_stack([process.predict(kept) for process in fits])
write(
    "sklearn_gaussian_process",
    version=sklearn.__version__,
    outputs=outputs,
    cpu_seconds=seconds,
    rmse=root_mean_square(predicted - truth[:, outputs]).tolist(),
)
