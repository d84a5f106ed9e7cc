"""emcee's ensemble: 120 walkers, 1200 steps, from Lacuna's starting points, densities of half the walkers at once.

Runs both the density by sufficient statistics and the one with a hand-made QR reduction; only the sampling is timed. The
densities at the starting points are compared with Lacuna's.
"""

import emcee
import numpy as np

from common import HEADER, array, timed, write
from posterior import Posterior

STEPS = 1200



def walk(emulator, squares):
    """One run and its results."""
    starts = array(f"{emulator}_start", 4)
    theirs = array(f"{emulator}_start_log_density", 1)[:, 0]
    density = Posterior(HEADER, emulator, squares)
    np.random.seed(1)
    sampler = emcee.EnsembleSampler(len(starts), 4, density, vectorize=True)
    _, seconds = timed(lambda: sampler.run_mcmc(starts, STEPS))
    draws = sampler.get_chain(discard=STEPS // 2, flat=True)
    return {
        "cpu_seconds": seconds,
        "largest_difference_at_start": np.abs(density(starts) - theirs).max(),
        "mean": draws.mean(axis=0).tolist(),
        "sd": draws.std(axis=0).tolist(),
    }


kinds = ["sufficient", "reduced"]
figures = {name: {k: walk(name, k) for k in kinds} for name in ["adaptive", "degree_10"]}
write("emcee_ensemble", version=emcee.__version__, **figures)
