"""Time and memory of whole runs against their size: runs, outputs, parameters, walkers, measured points.

    cargo build --release && python3 bench/scaling.py [AXIS | AXIS=SIZE | cores ...]

Writes one line for each size: wall time, peak memory of the process, memory of the largest table, and the exponent of
the time between this size and the one before (1: proportional). The simulator is a formula, so that the time is that of
Lacuna. `cores` runs the founding study with one thread and with two, and writes the time of each stage.
"""

import json
import math
import os
import pathlib
import random
import subprocess
import sys
import tempfile
import time

LACUNA = os.path.abspath(os.environ.get("LACUNA", "target/release/lacuna"))

STUDY = """
[study]
name = "scaling"
title = "A formula of any size"
seed = 1

{parameters}

[response]
name = "level"
unit = "m"
axes = {{ t = {{ first = 0.0, last = 2.0, count = {outputs}, unit = "s" }} }}

[model]
use = "equations"
where = {{ x = "t / (1 {{s}})" }}
observe = "({formula}) * (1 {{m}})"

[measurements]
use = "csv"
path = "data.csv"

[design]
use = "latin_hypercube"
runs = {runs}

[surrogate]
use = "polynomial_chaos"

[discrepancy]
use = "gaussian"
variance = {{ half_normal = 0.01 }}

[sampler]
use = "affine_invariant_ensemble"
walkers = {walkers}
steps = {steps}
"""

WAVES = "a*exp(-b*x)*sin(2*pi*(1+c)*x) + tanh(c*(x-1))/(1+a*b*x) + exp(-((x-0.5-b)/0.2)^2)"
RANGES = {"a": (0.5, 1.5, 1.1), "b": (0.2, 0.8, 0.45), "c": (0.2, 1.0, 0.6)}


def waves(x):
    """The response at the reference values."""
    a, b, c = (RANGES[name][2] for name in "abc")
    bump = math.exp(-(((x - 0.5 - b) / 0.2) ** 2))
    return a * math.exp(-b * x) * math.sin(2 * math.pi * (1 + c) * x) + math.tanh(c * (x - 1)) / (1 + a * b * x) + bump


def study(folder, runs=200, outputs=1000, parameters=3, walkers=120, steps=400, replicates=3):
    """Writes the study and its measurements."""
    ranges = dict(RANGES)
    formula = WAVES
    for k in range(parameters - 3):
        ranges[f"p{k}"] = (-1.0, 1.0, 0.0)
        formula += f" + 0.5*p{k}*sin({k + 1}*x)/{k + 1}"
    tables = "\n".join(
        f'[[parameter]]\nname = "{name}"\nprior = {{ uniform = [{low}, {high}] }}\nreference = {value}\n'
        for name, (low, high, value) in ranges.items()
    )
    text = STUDY.format(parameters=tables, outputs=outputs, formula=formula, runs=runs, walkers=walkers, steps=steps)
    (folder / "study.toml").write_text(text)
    noise = random.Random(1)
    with open(folder / "data.csv", "w") as out:
        out.write("replicate,t [s],level [m]\n")
        for replicate in range(1, replicates + 1):
            for i in range(outputs):
                t = 2.0 * i / (outputs - 1)
                out.write(f"{replicate},{t!r},{waves(t) + noise.gauss(0.0, 0.02):.6f}\n")


def measured(folder):
    """Wall time in s and peak memory in MiB of the run; the last line of its messages if it failed."""
    begun = time.monotonic()
    command = [LACUNA, "run", "study.toml", "--out", "run"]
    process = subprocess.Popen(command, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    said = process.stderr.read()
    _, status, usage = os.wait4(process.pid, 0)
    if status != 0:
        lines = [line for line in said.splitlines() if line.strip()]
        return None, usage.ru_maxrss / 1024, lines[0] if lines else f"status {status}"
    return time.monotonic() - begun, usage.ru_maxrss / 1024, ""


AXES = {
    "runs": [{"runs": n} for n in (600, 2000, 10_000, 100_000)],
    "outputs": [{"outputs": n} for n in (1000, 10_000, 100_000, 1_000_000)],
    "parameters": [{"parameters": n, "outputs": 100, "runs": 500, "walkers": max(120, 4 * n)} for n in (3, 10, 30, 100)],
    "walkers": [{"walkers": n, "outputs": 100} for n in (120, 1000, 10_000)],
    "points": [{"replicates": n, "outputs": 100} for n in (200, 2000, 20_000, 200_000)],
}
SIZES = {"runs": "runs", "outputs": "outputs", "parameters": "parameters", "walkers": "walkers", "points": "replicates"}


def cores():
    """Seconds of each stage of the founding study with one thread and with two, for stages of more than 2 s."""
    seconds = {}
    for threads in (1, 2):
        with tempfile.TemporaryDirectory() as out:
            command = [LACUNA, "--threads", str(threads), "run", "configs/sns/focused.toml", "--out", out]
            subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            for stage in json.loads((pathlib.Path(out) / "manifest.json").read_text())["stages"]:
                seconds.setdefault(stage["stage"], []).append(stage["seconds"])
    print("| stage | one thread [s] | two threads [s] | ratio |")
    print("|---|---|---|---|")
    for stage, (one, two) in seconds.items():
        if one > 2.0:
            print(f"| {stage} | {one:.1f} | {two:.1f} | {one / two:.2f} |")


def main():
    if "cores" in sys.argv[1:]:
        sys.argv.remove("cores")
        cores()
        if len(sys.argv) == 1:
            return
    for wanted in sys.argv[1:] or AXES:
        axis, _, only = wanted.partition("=")
        print(f"| {axis} | wall time [s] | peak memory [MiB] | table of runs [MiB] | exponent of the time |")
        print("|---|---|---|---|---|")
        before = None
        for case in AXES[axis]:
            if only and case[SIZES[axis]] != int(only):
                continue
            with tempfile.TemporaryDirectory() as folder:
                folder = pathlib.Path(folder)
                study(folder, **case)
                seconds, memory, error = measured(folder)
            size = case[SIZES[axis]] * (100 if axis == "points" else 1)
            table = 8 * case.get("runs", 200) * case.get("outputs", 1000) / 2**20
            if seconds is None:
                print(f"| {size} | {error} | {memory:.0f} | {table:.0f} | |", flush=True)
                continue
            exponent = math.log(seconds / before[1]) / math.log(size / before[0]) if before else None
            told = "" if exponent is None else f"{exponent:.2f}"
            print(f"| {size} | {seconds:.1f} | {memory:.0f} | {table:.0f} | {told} |", flush=True)
            before = (size, seconds)


if __name__ == "__main__":
    main()
