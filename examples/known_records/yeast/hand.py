"""The logistic law, fitted by least squares to the hours from which the search learned.

    python3 hand.py RUN
"""
import pathlib
import sys

HERE = pathlib.Path(__file__).parent
sys.path.insert(0, str(HERE.parent))
import numpy as np

from hand import Run, fit, rms, table

TIME, BIOMASS = table(HERE / "biomass.csv")


def exponential(parameters):
    growth, begin = parameters
    return begin * np.exp(growth * TIME[:, None])


def logistic(parameters):
    growth, begin, capacity = parameters
    return capacity / (1 + (capacity / begin - 1) * np.exp(-growth * TIME[:, None]))


def main():
    run = Run(sys.argv[1])
    for law, start in ((exponential, [0.2, 50.0]), (logistic, [0.5, 10.0, 600.0])):
        found, residual = fit(law, start, BIOMASS, run.used)
        values = ", ".join(f"{x:.4g}" for x in found)
        print(f"{law.__name__}: {values}; used {rms(residual[run.used]):.2f}, held out {rms(residual[~run.used]):.2f}")
    print("Lacuna, held out:", *(f"{e:.2f}" for e in run.held_out))


main()
