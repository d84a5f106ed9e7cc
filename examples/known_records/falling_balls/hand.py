"""Two drops of a ball with air drag, fitted by least squares to the points from which the search learned.

    python3 hand.py RUN
"""
import csv
import pathlib
import sys

HERE = pathlib.Path(__file__).parent
sys.path.insert(0, str(HERE.parent))
import numpy as np

from hand import Run, fit, rk4, rms

GRAVITY = 9.81                           # m/s²
DROPS = {}
for row in csv.DictReader(open(HERE / "height.csv")):
    DROPS.setdefault(row["scenario"], []).append((float(row["time [s]"]), float(row["height [m]"])))
DROPS = [np.array(rows).T for _, rows in sorted(DROPS.items())]
HEIGHT = np.concatenate([height for _, height in DROPS])


def main():
    run = Run(sys.argv[1])
    for title, power in (("no drag", None), ("linear drag", 1), ("quadratic drag", 2)):
        def simulate(p, power=power):
            columns = []
            for k, (time, _) in enumerate(DROPS):
                def rate(_, state):
                    v = state[1]
                    drag = p[4] * v * np.abs(v) ** (power - 1) if power else 0 * v
                    return np.array([v, -GRAVITY - drag])

                columns.append(rk4(rate, [p[2 * k], p[2 * k + 1]], time, 0.1)[:, 0])
            return np.concatenate(columns)

        start = [DROPS[0][1][0], 0.0, DROPS[1][1][0], 0.0] + ([0.2 / 10 ** (power - 1)] if power else [])
        found, residual = fit(simulate, start, HEIGHT, run.used, [1.0] * 4 + ([0.1 / 10 ** (power - 1)] if power else []))
        values = ", ".join(f"{x:.4g}" for x in found)
        print(f"{title}: {values}; used {rms(residual[run.used]):.4f}, held out {rms(residual[~run.used]):.4f} m")
    print("Lacuna, held out, m:", *(f"{e:.4f}" for e in run.held_out))


main()
