"""The cooling mug with evaporation, fitted by least squares to the points from which the search learned.

    python3 hand.py RUN
"""
import pathlib
import sys

HERE = pathlib.Path(__file__).parent
sys.path.insert(0, str(HERE.parent))
import numpy as np

from hand import Run, fit, rk4, rms, table

TIME, TEMPERATURE = table(HERE / "temperature.csv")


def simulate(parameters):
    loss, room, begin, evaporation, scale = parameters

    def rate(_, state):
        excess = state[0] - room
        return np.array([-loss * excess + evaporation * (1 - np.exp(excess / scale))])

    return rk4(rate, [begin], TIME, 0.5)[:, 0]


def main():
    run = Run(sys.argv[1])
    for title, start, count in (("Newton's law", [0.02, 24.0, 95.0], 3),
                                ("and evaporation", [0.003, 22.5, 98.5, 0.12, 23.0], 5)):
        def some(p):
            whole = np.zeros((5, p.shape[1]))
            whole[4] = 20.0
            whole[:count] = p
            return simulate(whole)

        found, residual = fit(some, start, TEMPERATURE, run.used)
        values = ", ".join(f"{x:.4g}" for x in found)
        print(f"{title}: {values}; used {rms(residual[run.used]):.4f}, held out {rms(residual[~run.used]):.4f} K")
    print("Lacuna, held out, K:", *(f"{e:.4f}" for e in run.held_out))


main()
