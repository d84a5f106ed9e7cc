"""Writes temperature.csv: the temperature of the rod for the conductivity 20 / (1 + sin(2 pi x) / 2) W/(m K), with noise of 0.2 K."""
import math
import random


def temperature(x):
    """The integral of 2000 (1 - s) / conductivity(s) from 0 to x."""
    w = 2.0 * math.pi
    wave = (1.0 - (1.0 - x) * math.cos(w * x)) / w - math.sin(w * x) / w**2
    return 100.0 * (x - 0.5 * x**2 + 0.5 * wave)


random.seed(1)
with open("temperature.csv", "w") as table:
    table.write("x [m],temperature [K]\n")
    for i in range(1, 21):
        x = i / 20
        table.write(f"{x},{temperature(x) + random.gauss(0.0, 0.2):.4f}\n")
