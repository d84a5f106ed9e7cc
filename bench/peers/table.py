"""Table of measured ratios and goals, from the results of all jobs: `python table.py FOLDER`."""

import json

import numpy as np

from common import FOLDER, HEADER

ROWS = [["job", "peer", "peer, CPU s", "Lacuna, CPU s", "ratio", "goal", ""]]


def figures(name):
    """Results that a job wrote; `None` if it has not run."""
    path = FOLDER / f"{name}.json"
    return json.loads(path.read_text()) if path.exists() else None


def row(job, peer, theirs, ours, goal, scale=1.0):
    """Line with the ratio of two times, the second scaled to equal error."""
    ratio = theirs / (ours * scale)
    verdict = "met" if ratio >= goal else "**missed**"
    ROWS.append([job, peer, f"{theirs:.3g}", f"{ours:.3g}", f"{ratio:.3g}", f">= {goal}", verdict])


def compare_errors(job, peer, theirs, ours):
    """Line with the means of two errors."""
    theirs, ours = np.mean(theirs), np.mean(ours)
    verdict = "met" if ours <= theirs else "**missed**"
    goal = "no worse"
    ROWS.append([job, peer, f"{theirs:.4g}", f"{ours:.4g}", f"{theirs / ours:.3g}", goal, verdict])


def expansions():
    ours, theirs = figures("lacuna_polynomial_chaos"), figures("sklearn_polynomial_chaos")
    if ours is None:
        return
    job, adaptive, small = "sparse expansion, one output", ours["adaptive"], ours["degree_10"]
    one = adaptive["cpu_seconds_of_an_output"]
    if theirs is not None:
        peer = f"scikit-learn {theirs['version']}, degree adaptive"
        row(job, peer, theirs["cpu_seconds_of_an_output"], one, 20)
        same = np.array(adaptive["rmse"])[theirs["outputs"]]
        compare_errors("its validation RMSE, microstrain", peer, theirs["rmse"], same)
        ten = theirs["cpu_seconds_of_an_output_of_degree_10"]
        peer = f"scikit-learn {theirs['version']}, both of degree 10"
        row(job, peer, ten, small["cpu_seconds_of_an_output"], 20)
    openturns(job, adaptive, small)
    row("sparse expansion, all 1000 outputs", "limit of 15 s", 15.0, adaptive["cpu_seconds"], 1)


def openturns(job, adaptive, small):
    theirs = figures("openturns_polynomial_chaos")
    if theirs is None:
        return
    peer = f"OpenTURNS {theirs['version']}"
    for kind, name, ours in [
        ("default", "degree 10; ours adaptive", adaptive),
        ("default", "both of degree 10", small),
        ("cholesky", "both of degree 10, Cholesky", small),
        ("cholesky_20", "degree 20, Cholesky; ours adaptive", adaptive),
    ]:
        case = theirs[kind]
        seconds = case["cpu_seconds_of_an_output"]
        row(job, f"{peer}, {name}", seconds, ours["cpu_seconds_of_an_output"], 100)
        same = np.array(ours["rmse"])[case["outputs"]]
        compare_errors("its validation RMSE, microstrain", f"{peer}, {name}", case["rmse"], same)


def ensembles():
    ours, theirs = figures("lacuna_ensemble"), figures("emcee_ensemble")
    if ours is None or theirs is None:
        return
    for emulator in ["adaptive", "degree_10"]:
        seconds = ours[emulator]["cpu_seconds"]
        job, peer = f"ensemble, {emulator} emulator", f"emcee {theirs['version']}"
        for kind, name, goal in [("sufficient", "sufficient statistics", 20), ("reduced", "QR", 5)]:
            row(job, f"{peer}, {name}", theirs[emulator][kind]["cpu_seconds"], seconds, goal)


def evaluations():
    ours, theirs = figures("lacuna_evaluation"), figures("numpy_evaluation")
    if ours is None or theirs is None:
        return
    best = [min(f["cpu_seconds_by_chunk"].values()) for f in (theirs, ours)]
    peer = f"NumPy {theirs['version']}, differs by {theirs['difference']:.0e}"
    row("100,000 evaluations of 1000 outputs", peer, *best, 2)


def processes():
    ours, theirs = figures("lacuna_gaussian_process"), figures("sklearn_gaussian_process")
    if ours is None or theirs is None:
        return
    peer = f"scikit-learn {theirs['version']}"
    row("Gaussian processes, 10 outputs", peer, theirs["cpu_seconds"], ours["cpu_seconds"], 5)
    compare_errors("their validation RMSE, microstrain", peer, theirs["rmse"], ours["rmse"])


def evidences():
    ours, theirs = figures("lacuna_evidence"), figures("dynesty_evidence")
    if ours is None or theirs is None:
        return
    error = max(ours["error"], ours["error_seen"])
    peer = f"dynesty {theirs['version']}, error {theirs['error']:.2f} beside {error:.2f}"
    scale = (error / theirs["error"]) ** 2
    row("evidence, at equal error", peer, theirs["cpu_seconds"], ours["cpu_seconds"], 10, scale)


for part in [expansions, ensembles, evaluations, processes, evidences]:
    part()
ROWS.insert(1, ["---"] * len(ROWS[0]))
print(f"Problem: {HEADER['shapes']}")
for cells in ROWS:
    print("| " + " | ".join(cells) + " |")
