"""The data of configs/records: carts that roll down inclines, three records of different lengths and times.

Run: python3 examples/records.py configs/records
"""

import csv
import math
import random
import sys
from pathlib import Path

GRAVITY, RESISTANCE = 9.81, 0.35  # m/s2; m/s2: the truth
NOISE = 0.01  # m
# angle in degrees, position and speed at the start, the times
RECORDS = {
    "gentle": (4.0, 0.10, 0.20, [0.05 * i for i in range(0, 81)]),
    "middle": (9.0, -0.05, 0.00, [0.02 * i for i in range(0, 101)]),
    "steep": (15.0, 0.30, -0.50, [2.0 * (i / 60) ** 1.5 for i in range(0, 61)]),
}

noise = random.Random(20261121)
with open(Path(sys.argv[1]) / "position.csv", "w", newline="") as file:
    table = csv.writer(file, lineterminator="\n")
    table.writerow(("scenario", "replicate", "time [s]", "position [m]"))
    for name, (angle, start, speed, times) in RECORDS.items():
        pull = GRAVITY * math.sin(math.radians(angle)) - RESISTANCE
        for t in (round(t, 6) for t in times):
            position = start + speed * t + 0.5 * pull * t * t + noise.gauss(0, NOISE)
            table.writerow((name, 1, t, f"{position:.5f}"))
