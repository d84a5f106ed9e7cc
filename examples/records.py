"""The data of configs/records: two masses on springs, driven by three measured forces.

Integrated here with the classical Runge-Kutta rule at a fixed step, which is not how Lacuna integrates it.
Run: python3 examples/records.py configs/records
"""

import csv
import math
import random
import sys
from pathlib import Path

FOLDER = Path(sys.argv[1])
MASS = (2.0, 1.0)  # kg
SPRING = (850.0, 320.0)  # N/m: the truth
DAMPING, PER_DEGREE = 1.8, 0.06  # N s/m at 20 degC, N s/m per degree: the truth
NOISE = 0.2  # mm
STEP = 1e-3  # s


def hammer(t):
    return 40.0 * math.exp(-(((t - 0.3) / 0.05) ** 2))


def sweep(t):
    return 6.0 * math.sin(2 * math.pi * (0.6 * t + 0.25 * t * t))


def steps(t):
    return [0.0, 8.0, -5.0, 3.0, 0.0][min(int(t / 0.9), 4)] + 2.0 * math.sin(9 * t)


# force, its sampling, the times of the record, temperature in degC, start of the lower mass in mm, what is seen
RECORDS = {
    "hammer": (hammer, 0.02, [0.02 * i for i in range(1, 101)], 14.0, 0.0, ("lower", "upper")),
    "sweep": (sweep, 0.05, [0.025 * i for i in range(1, 161)], 21.0, 4.0, ("lower", "upper")),
    "steps": (steps, 0.03, [0.9 * 3.3 * (i / 90) ** 1.3 for i in range(1, 91)], 35.0, -7.0, ("upper",)),
}


def between(table, t):
    """Linear between the rows of a table, which is what the model is told."""
    at = min(max(t / table[1][0], 0.0), len(table) - 1.000001)
    i = int(at)
    return table[i][1] + (at - i) * (table[i + 1][1] - table[i][1])


def rates(state, force, damping):
    x1, v1, x2, v2 = state
    spring = SPRING[1] * (x2 - x1) + damping * (v2 - v1)
    return (
        v1,
        (force - SPRING[0] * x1 - damping * v1 + spring) / MASS[0],
        v2,
        -spring / MASS[1],
    )


def step(state, t, h, table, damping):
    add = lambda s, k, f: tuple(a + f * b for a, b in zip(s, k))
    k1 = rates(state, between(table, t), damping)
    k2 = rates(add(state, k1, h / 2), between(table, t + h / 2), damping)
    k3 = rates(add(state, k2, h / 2), between(table, t + h / 2), damping)
    k4 = rates(add(state, k3, h), between(table, t + h), damping)
    return tuple(s + h / 6 * (a + 2 * b + 2 * c + d) for s, a, b, c, d in zip(state, k1, k2, k3, k4))


def main():
    noise = random.Random(20261121)
    rows = []
    for name, (force, sampling, times, temperature, start, seen) in RECORDS.items():
        count = round(times[-1] / sampling) + 2
        table = [(round(sampling * i, 6), round(force(sampling * i), 6)) for i in range(count)]
        with open(FOLDER / f"{name}.csv", "w", newline="") as file:
            csv.writer(file, lineterminator="\n").writerows([("time [s]", "force [N]"), *table])
        damping = DAMPING + PER_DEGREE * (temperature - 20)
        state, t = (start / 1000, 0.0, 0.0, 0.0), 0.0
        for until in (round(t, 6) for t in times):
            while t < until - 1e-12:
                h = min(STEP, until - t)
                state = step(state, t, h, table, damping)
                t += h
            for mass, x in (("lower", state[0]), ("upper", state[2])):
                if mass in seen:
                    rows.append((name, 1, mass, until, f"{1000 * x + noise.gauss(0, NOISE):.4f}"))
    with open(FOLDER / "displacement.csv", "w", newline="") as file:
        heads = ("scenario", "replicate", "mass", "time [s]", "displacement [mm]")
        csv.writer(file, lineterminator="\n").writerows([heads, *rows])


main()
