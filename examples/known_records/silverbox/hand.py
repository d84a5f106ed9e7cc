"""The oscillator with a cubic spring, fitted by least squares to the points from which the search learned, and its errors on
the arrow-shaped record.

    python3 hand.py RUN
"""
import pathlib
import sys

HERE = pathlib.Path(__file__).parent
sys.path.insert(0, str(HERE.parent))
import numpy as np
from scipy.interpolate import CubicSpline

from hand import Run, fit, rms, table

PARTS = 4                                # steps of the integration in one sample


def simulate(parameters, times, drive):
    """The voltages at the samples; a voltage for each column of parameters."""
    frequency, damping, gain, begin, begin_rate, cubic = parameters
    stiffness = (2 * np.pi * frequency) ** 2
    h = (times[-1] - times[0]) / (len(times) - 1) / PARTS
    force = drive(times[0] + 0.5 * h * np.arange(2 * PARTS * (len(times) - 1) + 1))
    x, v = begin + 0 * frequency, begin_rate + 0 * frequency
    out = [x]

    def rate(f, x, v):
        return stiffness * (gain * f - x) - damping * v - cubic * x**3

    for i in range(PARTS * (len(times) - 1)):
        a, b, c = force[2 * i: 2 * i + 3]
        k1 = rate(a, x, v)
        k2 = rate(b, x + h / 2 * v, v + h / 2 * k1)
        k3 = rate(b, x + h / 2 * v + h * h / 4 * k1, v + h / 2 * k2)
        k4 = rate(c, x + h * v + h * h / 2 * k2, v + h * k3)
        x = x + h * v + h * h / 6 * (k1 + k2 + k3)
        v = v + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        if (i + 1) % PARTS == 0:
            out.append(x)
    return np.array(out)


def main():
    run = Run(sys.argv[1])
    time, voltage = table(HERE / "voltage-multisine.csv")
    drive = CubicSpline(*table(HERE / "drive-multisine.csv"))
    fits = {}
    for title, count in (("linear", 5), ("cubic", 6)):
        def some(p, count=count):
            whole = np.zeros((6, p.shape[1]))
            whole[:count] = p
            return simulate(whole, time, drive)

        start, scale = [68.5, 42.0, 1.0, 0.026, -2.0, 7e5], [5.0, 10.0, 0.1, 0.01, 1.0, 1e5]
        found, residual = fit(some, start[:count], voltage, run.used, scale[:count])
        fits[title] = np.append(found, np.zeros(6 - count))
        values = ", ".join(f"{x:.5g}" for x in found)
        print(f"{title}: {values}; used {1e3 * rms(residual[run.used]):.3f}, held out {1e3 * rms(residual[~run.used]):.3f} mV")
    print("Lacuna, held out, mV:", *(f"{1e3 * e:.3f}" for e in run.held_out))
    # The arrow: another part of the record, whose amplitude grows beyond that of the multisine.
    found = run.gap["parameters"]
    ours = [found[name]["after"]["map"] for name in ("frequency", "damping", "gain", "begin", "begin_rate")]
    ours.append(run.gap["effects"][0]["parameters"]["cubic_stiffness"]["mean"])
    time, voltage = table(HERE / "voltage-arrow.csv")
    drive = CubicSpline(*table(HERE / "drive-arrow.csv"))
    for title, values in (("linear", fits["linear"]), ("cubic", fits["cubic"]), ("Lacuna", np.array(ours))):
        values = values.copy()
        values[3:5] = voltage[0], (voltage[1] - voltage[0]) / (time[1] - time[0])
        error = simulate(values[:, None], time, drive)[:, 0] - voltage
        print(f"arrow, {title}: {1e3 * rms(error):.3f} mV; first 25000 samples {1e3 * rms(error[:25000]):.3f} mV", flush=True)


main()
