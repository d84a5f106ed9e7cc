"""The amplitudes with the friction of the literature, fitted by least squares to the points from which the search learned.

    python3 hand.py RUN
"""
import pathlib
import sys

HERE = pathlib.Path(__file__).parent
sys.path.insert(0, str(HERE.parent))
import numpy as np

from hand import Run, fit, rk4, rms, table

TIME, AMPLITUDE = table(HERE / "amplitude.csv")


def main():
    run = Run(sys.argv[1])
    start, scale = [0.01, 0.42, 0.002, 0.01], [0.01, 0.1, 0.002, 0.01]
    for title, free in (("linear damping", [0, 1]), ("dry friction", [0, 1, 2]), ("dry friction and quadratic drag", [0, 1, 2, 3])):
        def simulate(p, free=free):
            whole = np.zeros((4, p.shape[1]))
            whole[free] = p
            decay, begin, dry, drag = whole
            rate = lambda _, state: np.array([-decay * state[0] - dry - drag * state[0] ** 2])
            return rk4(rate, [begin], np.append(0.0, TIME), 0.5)[1:, 0]

        found, residual = fit(simulate, np.take(start, free), AMPLITUDE, run.used, np.take(scale, free))
        values = ", ".join(f"{x:.4g}" for x in found)
        print(f"{title}: {values}; used {1e3 * rms(residual[run.used]):.3f}, held out {1e3 * rms(residual[~run.used]):.3f} mrad")
    print("Lacuna, held out, mrad:", *(f"{1e3 * e:.3f}" for e in run.held_out))


main()
