"""The tanks with Torricelli's outlets, and with an upper tank that runs over into the lower one, fitted by least squares to the
first record.

    python3 hand.py RUN
"""
import pathlib
import sys

HERE = pathlib.Path(__file__).parent
sys.path.insert(0, str(HERE.parent))
import numpy as np

from hand import Run, fit, rms, table

NAMES = ["pump_gain 1/s", "upper 1/s", "lower 1/s", "begin V", "brim V", "caught"]
START = [0.04, 0.04, 0.044, 4.0, 8.0, 0.5]
SCALE = [0.05, 0.05, 0.05, 5.0, 5.0, 0.3]
LOW, HIGH = [1e-3, 1e-3, 1e-3, 0.1, 2.0, 0.0], [1.0, 1.0, 1.0, 20.0, 50.0, 1.0]
STEPS = 8                                # integration steps in one held value of the pump


def simulate(parameters, pump, step):
    """The lower levels in V at the ends of the steps of the pump: above its brim the upper tank keeps its level, and a share of
    what it cannot take is caught by the lower one. The lower one cannot hold more than 10 V."""
    gain, upper, lower, begin, brim, caught = parameters
    a, b = begin + 0 * gain, 5.1 + 0 * gain
    h = step / STEPS
    out = []
    for u in pump:
        for _ in range(STEPS):
            through = upper * np.sqrt(np.maximum(a, 0))
            a = a + h * (gain * u - through)
            over = np.maximum(a - brim, 0) / h
            a = np.minimum(a, brim)
            b = np.minimum(b + h * (through + caught * over - lower * np.sqrt(np.maximum(b, 0))), 10.0)
        out.append(b)
    return np.array(out)


def main():
    data = {}
    for name in ("estimation", "validation"):
        time, pump = table(HERE / f"pump-{name}.csv")
        _, level = table(HERE / f"level-{name}.csv")
        data[name] = (pump[: len(level)], level, time[1] - time[0])
    pump, level, step = data["estimation"]
    for title, free, rest in FITS:
        def whole(p, free=free, rest=rest):
            full = np.tile(np.array(rest, dtype=float)[:, None], p.shape[1])
            full[free] = p
            return full

        bounds = (np.take(LOW, free), np.take(HIGH, free))
        found, residual = fit(lambda p: simulate(whole(p), pump, step), np.take(START, free), level, None, np.take(SCALE, free), bounds)
        values = ", ".join(f"{NAMES[k]} {x:.4g}" for k, x in zip(free, found))
        other, truth, _ = data["validation"]
        test = simulate(whole(found[:, None]), other, step)[:, 0] - truth
        print(f"{title}: {values}; first record {rms(residual):.3f}, held out {rms(test):.3f} V", flush=True)
    if len(sys.argv) > 1:
        print("Lacuna, held out, V:", *(f"{e:.3f}" for e in Run(sys.argv[1]).held_out))


NEVER = 1e3                              # V: a brim that is not reached
FITS = [("two outlets", [0, 1, 2, 3], [0, 0, 0, 0, NEVER, 0]), ("with an upper tank that runs over", [0, 1, 2, 3, 4, 5], [0] * 6)]
if __name__ == "__main__":
    main()
