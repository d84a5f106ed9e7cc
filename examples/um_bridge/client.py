"""A client of `lacuna serve`: the posterior's maximum and its Gaussian approximation, without an installation of Lacuna.

    lacuna run configs/um_bridge/study.toml
    lacuna serve configs/um_bridge/study.toml --port 4243
    python examples/um_bridge/client.py http://localhost:4243 -18.4 0.0019 0.06

The start is one number per unknown, in the order in which `lacuna serve` lists them. Prints one line of JSON: the
point, and the standard deviations that the curvature gives there.
"""

import json
import sys

import numpy as np
import umbridge


def gradient(model, point):
    return np.array(model.gradient(0, 0, [point.tolist()], [1.0]))


def hessian(model, point):
    inputs = [point.tolist()]
    columns = [model.apply_hessian(0, 0, 0, inputs, [1.0], e.tolist()) for e in np.eye(len(point))]
    return (np.array(columns) + np.array(columns).T) / 2


def ascent(gradient, hessian):
    """Newton step, uphill in every direction of curvature, with each unknown in its own scale."""
    scale = 1 / np.sqrt(np.abs(np.diag(hessian)))
    curvature, axes = np.linalg.eigh(hessian * np.outer(scale, scale))
    return scale * (axes @ ((axes.T @ (scale * gradient)) / np.abs(curvature)))


def maximum(model, point):
    """Newton's method, with steps that are halved until the density grows."""
    value = model([point.tolist()])[0][0]
    for _ in range(100):
        step = ascent(gradient(model, point), hessian(model, point))
        while True:
            moved = point + step
            grown = model([moved.tolist()])[0][0]
            if grown > value:
                break
            step /= 2
            if np.all(np.abs(step) <= 1e-9 * np.abs(point)):
                return point
        point, value = moved, grown
    return point


def main():
    url, start = sys.argv[1], np.array([float(text) for text in sys.argv[2:]])
    posterior = umbridge.HTTPModel(url, "posterior")
    best = maximum(posterior, start)
    spread = np.sqrt(np.diag(np.linalg.inv(-hessian(posterior, best))))
    emulator = umbridge.HTTPModel(url, "emulator")
    inputs = best[: emulator.get_input_sizes()[0]].tolist()
    response = emulator([inputs])[0]
    print(json.dumps({"maximum": best.tolist(), "sd": spread.tolist(), "response": response}))


if __name__ == "__main__":
    main()
