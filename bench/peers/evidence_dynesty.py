"""The evidence by dynesty: 500 live points, random walks, until 0.1 of the logarithm remains.

The density is the one with the QR reduction; dynesty evaluates one point at a time. The emulator is the
smaller one, of degree 10.
"""

import dynesty
import numpy as np
from scipy.special import ndtri

from common import HEADER, HIGH, LOW, timed, write
from posterior import Posterior

density = Posterior(HEADER, "degree_10", "reduced")


def log_likelihood(natural):
    """The log posterior density less the prior, as a function of the parameters and the variance."""
    logs = np.log(natural[3])
    point = np.append(natural[:3], logs)[None, :]
    prior = density.constant - 0.5 * (natural[3] / density.scale) ** 2
    return float(density(point)[0] - prior - logs)


def transform(unit):
    """Maps the unit cube to the prior."""
    variance = max(density.scale * ndtri(0.5 + 0.5 * unit[3]), 1e-300)
    return np.append(LOW + unit[:3] * (HIGH - LOW), variance)


def run():
    generator = np.random.default_rng(1)
    options = {"nlive": 500, "bound": "multi", "sample": "rwalk", "rstate": generator}
    sampler = dynesty.NestedSampler(log_likelihood, transform, 4, **options)
    sampler.run_nested(dlogz=0.1, print_progress=False)
    return sampler.results


results, seconds = timed(run)
write(
    "dynesty_evidence",
    version=dynesty.__version__,
    cpu_seconds=seconds,
    log_evidence=results.logz[-1],
    error=results.logzerr[-1],
    evaluations=int(np.sum(results.ncall)),
)
