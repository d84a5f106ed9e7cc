"""The pendulum with the sine of its angle, fitted by least squares to the points from which the search learned.

    python3 hand.py RUN
"""
import pathlib
import sys

HERE = pathlib.Path(__file__).parent
sys.path.insert(0, str(HERE.parent))
import numpy as np

from hand import Run, fit, rk4, rms, table

TIME, ANGLE = table(HERE / "angle.csv")
FORCES = {"linear": lambda x: x, "sine": np.sin, "cubic": lambda x: x - x**3 / 6}


def main():
    run = Run(sys.argv[1])
    for title, force in FORCES.items():
        def simulate(parameters, force=force):
            frequency, damping, rest, begin, begin_rate = parameters

            def rate(_, state):
                x, v = state
                return np.array([v, -frequency**2 * force(x - rest) - damping * v])

            return rk4(rate, [begin, begin_rate], TIME, 0.04)[:, 0]

        found, residual = fit(simulate, [5.0 if title == "linear" else 5.057, 0.018, 0.004, 0.41, 0.1], ANGLE, run.used, [0.05, 0.01, 0.01, 0.1, 0.5])
        values = ", ".join(f"{x:.4g}" for x in found)
        print(f"{title}: {values}; used {1e3 * rms(residual[run.used]):.3f}, held out {1e3 * rms(residual[~run.used]):.3f} mrad")
    print("Lacuna, held out, mrad:", *(f"{1e3 * e:.3f}" for e in run.held_out))


main()
