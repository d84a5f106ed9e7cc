"""A straight line with normal priors and known noise, whose posterior is known in closed form."""

import numpy as np
import pytest

TIMES = np.arange(1.0, 7.0)
PRIOR = np.array([1.0, 0.5])
NOISE = 0.5


@pytest.fixture(scope="session")
def line(tmp_path_factory):
    """Folder with the runs and the measurements of a line."""
    folder = tmp_path_factory.mktemp("line")
    random = np.random.default_rng(5)
    points = PRIOR * random.standard_normal((40, 2))
    with open(folder / "runs.csv", "w") as file:
        file.write("run,level0 [m],rise [m/s]\n")
        file.writelines(f"r{i},{a!r},{b!r}\n" for i, (a, b) in enumerate(points.tolist()))
    with open(folder / "responses.csv", "w") as file:
        file.write("run,t [s],level [m]\n")
        for i, (a, b) in enumerate(points.tolist()):
            file.writelines(f"r{i},{t},{a + b * t!r}\n" for t in TIMES.tolist())
    data = 0.7 - 0.4 * TIMES + NOISE * random.standard_normal((4, len(TIMES)))
    with open(folder / "line.csv", "w") as file:
        file.write("replicate,t [s],level [m]\n")
        for r, row in enumerate(data.tolist()):
            file.writelines(f"{r + 1},{t},{y!r}\n" for t, y in zip(TIMES.tolist(), row))
    return folder, data


@pytest.fixture(scope="session")
def study(line):
    """The study as a dictionary."""
    folder, _ = line
    return {
        "study": {"name": "line", "title": "A straight line", "seed": 1},
        "parameter": [
            {"name": "level0", "unit": "m", "prior": {"normal": [0.0, 1.0]}},
            {"name": "rise", "unit": "m/s", "prior": {"normal": [0.0, 0.5]}},
        ],
        "response": {
            "name": "level",
            "unit": "m",
            "axes": {"t": {"first": 1.0, "last": 6.0, "count": np.int64(6), "unit": "s"}},
        },
        "simulations": {
            "use": "csv",
            "parameters": folder / "runs.csv",
            "responses": folder / "responses.csv",
        },
        "measurements": {"use": "csv", "path": folder / "line.csv"},
        "surrogate": {"use": "polynomial_chaos", "degree": {"max": 1}, "validation": 10},
        "discrepancy": {
            "use": "gaussian",
            "variance": {"known": np.float64(NOISE**2)},
            "replicate_error": False,
        },
        "sampler": {"use": "affine_invariant_ensemble", "walkers": 20, "steps": 2500},
    }


@pytest.fixture(scope="session")
def finished(study, tmp_path_factory):
    """A finished run of the study."""
    import lacuna

    events = []
    out = tmp_path_factory.mktemp("runs") / "line"
    run = lacuna.run(study, out=out, progress=lambda *event: events.append(event))
    return run, events
