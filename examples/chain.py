"""Free vibration of two masses in a row, each held by a spring and a damper: a simulator in plain Python.

The study `configs/python` calibrates `simulate`. `python3 examples/chain.py` makes the study's measured data:
the motion at known parameters with independent normal noise.
"""

MASSES = (1.0, 1.0)  # kg
START = (0.01, 0.0)  # displacements at rest, m
STEP = 2.5e-3  # s


def accelerations(state, stiffness_wall, stiffness_link, damping):
    """Newton's law for (x1, x2, v1, v2): one spring to the wall, one between the masses, a damper in each."""
    x1, x2, v1, v2 = state
    link = stiffness_link * (x2 - x1) + damping * (v2 - v1)
    wall = stiffness_wall * x1 + damping * v1
    return (v1, v2, (link - wall) / MASSES[0], -link / MASSES[1])


def advance(state, h, *constants):
    """One step of the classical Runge-Kutta method."""

    def moved(slope, share):
        return [y + share * h * k for y, k in zip(state, slope)]

    a = accelerations(state, *constants)
    b = accelerations(moved(a, 0.5), *constants)
    c = accelerations(moved(b, 0.5), *constants)
    d = accelerations(moved(c, 1.0), *constants)
    return [y + h / 6 * (p + 2 * q + 2 * r + s) for y, p, q, r, s in zip(state, a, b, c, d)]


def simulate(stiffness_wall, stiffness_link, damping, layout):
    """Displacements in mm, by mass, at the times of the layout."""
    times = layout["axes"][1]["values"]
    state, now, found = [*START, 0.0, 0.0], 0.0, []
    for time in times:
        steps = max(1, round((time - now) / STEP))
        for _ in range(steps):
            state = advance(state, (time - now) / steps, stiffness_wall, stiffness_link, damping)
        now = time
        found.append((1e3 * state[0], 1e3 * state[1]))
    first, second = zip(*found)
    return {"first": first, "second": second}


TRUTH = {"stiffness_wall": 400.0, "stiffness_link": 250.0, "damping": 1.5}
NOISE = 0.2  # mm


def measure(path):
    import random

    noise = random.Random(20261121)
    times = [round(0.05 * i, 2) for i in range(1, 41)]
    layout = {"axes": [{"name": "mass", "labels": ["first", "second"]}, {"name": "time", "values": times}]}
    truth = simulate(**TRUTH, layout=layout)
    with open(path, "w") as file:
        file.write("replicate,mass,time [s],displacement [mm]\n")
        for replicate in range(1, 5):
            for mass, values in truth.items():
                for time, value in zip(times, values):
                    file.write(f"{replicate},{mass},{time},{noise.gauss(value, NOISE):.3f}\n")


if __name__ == "__main__":
    import os

    measure(os.path.join(os.path.dirname(__file__), "../configs/python/displacement.csv"))
