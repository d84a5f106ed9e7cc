"""emcee's ensemble: 120 walkers, 1200 steps, from Lacuna's starting points, densities of half the walkers at once.

Both the density by sufficient statistics and the one with a hand-made QR reduction; the walk alone is timed. The
densities at the starting points are compared with Lacuna's.
"""

import emcee
import numpy as np

from common import HEADER, array, timed, write
from posterior import Posterior

STEPS = 1200

starts = array("start", 4)
theirs = array("start_log_density", 1)[:, 0]
np.random.seed(1)
figures = {}
for name in ["sufficient", "reduced"]:
    density = Posterior(HEADER, name)
    sampler = emcee.EnsembleSampler(len(starts), 4, density, vectorize=True)
    _, seconds = timed(lambda: sampler.run_mcmc(starts, STEPS))
    draws = sampler.get_chain(discard=STEPS // 2, flat=True)
    figures[name] = {
        "cpu_seconds": seconds,
        "largest_difference_at_start": np.abs(density(starts) - theirs).max(),
        "mean": draws.mean(axis=0).tolist(),
        "sd": draws.std(axis=0).tolist(),
    }
    print(name, figures[name])
write("emcee_ensemble", version=emcee.__version__, **figures)
