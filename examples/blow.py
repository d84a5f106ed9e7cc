"""Makes the data of configs/composed: a gauge that lags behind a mass on a spring, which is struck.

Run: python3 examples/blow.py configs/composed
"""

import csv
import math
import random
import sys
from pathlib import Path

PEAK, STIFFNESS, DAMPING, LAG = 40.0, 90.0, 1.5, 0.06  # N; N/m; kg/s; s: the truth
MASS, SENSITIVITY, DURATION = 2.0, 5.0, 0.4  # kg; V/m; s
NOISE = 0.02  # V
STEP = 1e-4  # s


def rates(t, state):
    """Newton's law for the mass at (x, v), and the gauge's reading u, which follows with its lag."""
    x, v, u = state
    force = PEAK * math.sin(math.pi * t / DURATION) if t < DURATION else 0.0
    return v, (force - DAMPING * v - STIFFNESS * x) / MASS, (SENSITIVITY * x - u) / LAG


def advance(t, state):
    """One step by the midpoint rule."""
    middle = [y + 0.5 * STEP * k for y, k in zip(state, rates(t, state))]
    return [y + STEP * k for y, k in zip(state, rates(t + 0.5 * STEP, middle))]


reading, state = {}, [0.0, 0.0, 0.0]
for step in range(30_000):
    state = advance(step * STEP, state)
    reading[step + 1] = state[2]

noise = random.Random(20261121)
with open(Path(sys.argv[1]) / "signal.csv", "w", newline="") as file:
    table = csv.writer(file, lineterminator="\n")
    table.writerow(("replicate", "time [s]", "signal [V]"))
    for replicate in (1, 2, 3):
        for k in range(1, 61):
            value = reading[500 * k] + noise.gauss(0, NOISE)
            table.writerow((replicate, round(0.05 * k, 2), f"{value:.5f}"))
