"""Writes damage.csv, the fatigue damage of the true strain in truth.csv, by the package `rainflow` (ASTM E1049-85).

The law is that of the study: Coffin, Manson and Basquin with Morrow's mean stress, 316L stainless steel.
"""

import csv
from collections import defaultdict
from pathlib import Path

import rainflow

MODULUS, STRENGTH, B, DUCTILITY, C = 193e9, 1000e6, -0.114, 0.171, -0.402


def life(amplitude, mean_stress):
    """Cycles to failure: the amplitude falls with the number of reversals, so bisection of its logarithm finds it."""

    def strain(reversals):
        return (STRENGTH - mean_stress) / MODULUS * reversals**B + DUCTILITY * reversals**C

    low, high = 1e-3, 1e60
    for _ in range(400):
        middle = (low * high) ** 0.5
        low, high = (middle, high) if strain(middle) > amplitude else (low, middle)
    return low / 2


def damage(strain):
    cycles = rainflow.extract_cycles(strain)
    return sum(n / life(0.5 * span, MODULUS * mean) for span, mean, n, _, _ in cycles if span > 0)


curves = defaultdict(list)
with open(Path(__file__).parent / "truth.csv", newline="") as file:
    for row in csv.DictReader(file):
        key = row["target"], float(row["pulse_energy"]), row["sensor"]
        curves[key].append(1e-6 * float(row["strain [microstrain]"]))
with open(Path(__file__).parent / "damage.csv", "w", newline="") as file:
    table = csv.writer(file, lineterminator="\n")
    table.writerow(["pulse_energy", "sensor", "damage", "range [microstrain]"])
    for (target, energy, sensor), strain in curves.items():
        if target == "next":
            span = 1e6 * (max(strain) - min(strain))
            table.writerow([f"{energy:g}", sensor, f"{damage(strain):.8e}", f"{span:.3f}"])
