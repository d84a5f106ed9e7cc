"""The drive with the friction of the literature, fitted by least squares to the record from which the search learned.

    python3 hand.py RUN
"""
import pathlib
import sys

HERE = pathlib.Path(__file__).parent
sys.path.insert(0, str(HERE.parent))
import numpy as np

from hand import Run, fit, rms, table

NAMES = ["mass kg", "viscous kg/s", "bias N", "Coulomb N", "quadratic kg/m", "Stribeck rise", "asymmetry N"]
START, SCALE = [100.0, 300.0, 3.0, 15.0, 1.0, 0.1, 1.0], [100.0, 200.0, 3.0, 20.0, 100.0, 1.0, 3.0]
STEPS = 8                                # integration steps in one held value of the force


def simulate(parameters, force, step):
    """The positions in mm at the ends of the steps of a held force, from rest."""
    mass, viscous, bias, coulomb, quadratic, rise, asymmetry = parameters
    x, v = np.zeros((2, parameters.shape[1]))
    h = step / STEPS

    def rate(v, f):
        dry = coulomb * (1 + rise * np.exp(-(v / 0.02) ** 2)) * np.tanh(v / 0.002)
        return (f + bias - viscous * v - quadratic * v * np.abs(v) - dry - asymmetry * (v > 0) * v / 0.1) / mass

    out = []
    for f in force:
        for _ in range(STEPS):
            k1 = rate(v, f)
            k2 = rate(v + h / 2 * k1, f)
            k3 = rate(v + h / 2 * k2, f)
            k4 = rate(v + h * k3, f)
            x = x + h * v + h * h / 6 * (k1 + k2 + k3)
            v = v + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        out.append(1e3 * x)
    return np.array(out)


def main():
    data = {}
    for name in ("tracking", "pulses"):
        time, force = table(HERE / f"force-{name}.csv")
        _, position = table(HERE / f"position-{name}.csv")
        data[name] = (force[: len(position)], 1e3 * position, time[1] - time[0])
    force, position, step = data["tracking"]
    for title, free in FITS.items():
        def whole(p, free=free):
            all_of_them = np.zeros((len(START), p.shape[1]))
            all_of_them[free] = p
            return all_of_them

        found, residual = fit(lambda p: simulate(whole(p), force, step), np.take(START, free), position, None, np.take(SCALE, free))
        values = ", ".join(f"{NAMES[k]} {x:.4g}" for k, x in zip(free, found))
        other, truth, _ = data["pulses"]
        test = simulate(whole(found[:, None]), other, step)[:, 0] - truth
        print(f"{title}: {values}; first record {rms(residual):.3f}, held out {rms(test):.3f} mm", flush=True)
    if len(sys.argv) > 1:
        print("Lacuna, held out, mm:", *(f"{e:.3f}" for e in Run(sys.argv[1]).held_out))


FITS = {"inertia and viscous friction": [0, 1], "with a bias": [0, 1, 2], "with bias and Coulomb friction": [0, 1, 2, 3]}
if __name__ == "__main__":
    main()
