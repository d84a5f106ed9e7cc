"""One fit of the true model to the records of `inside`, by SciPy: the driven oscillator with its cubic stiffness.

    python bench/peers/inside_scipy.py [FOLDER]

The peer of a whole search: `least_squares` (trust region reflective, finite differences) around `solve_ivp` (RK45) with the relative
tolerance of the equations' default, 1e-8, from the values of the linear oscillator. Prints processor seconds. Needs numpy and scipy.
"""
import pathlib
import sys
import time

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares

START = np.array([13.0, 0.3, 4.5, 0.0, 0.3, 0.0])


def response(p, times):
    stiffness, damping, gain, cubic, begin, speed = p

    def rate(t, y):
        force = np.sin(2 * np.pi * 0.37 * t) + np.sin(2 * np.pi * 0.61 * t)
        return [y[1], gain * force - stiffness * y[0] - damping * y[1] - cubic * y[0] ** 3]

    solved = solve_ivp(rate, (0.0, times[-1]), [begin, speed], method="RK45", t_eval=times, rtol=1e-8, atol=1e-10)
    return solved.y[0] if solved.success and len(solved.y[0]) == len(times) else np.full(len(times), 1e3)


def main():
    folder = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else "target/bench-inside")
    print("points\tprocessor seconds of one fit\tcubic stiffness")
    for own in sorted(folder.iterdir(), key=lambda path: int(path.name)):
        _, times, values = np.loadtxt(own / "data.csv", delimiter=",", skiprows=1).T
        begun = time.process_time()
        found = least_squares(lambda p: (response(p, times) - values) / 0.005, START, x_scale=np.abs(START) + 0.1)
        print(f"{own.name}\t{time.process_time() - begun:.1f}\t{found.x[3]:.3f}", flush=True)


main()
