"""Two stochastic simulators whose posterior is known: the tables of stochastic simulators in docs/model_error.md.

    python bench/stochastic.py LACUNA [--out FOLDER]

LACUNA is the program. The first model is `location + u` with a uniform number from -1 to 1 in each run, and normal noise;
its posterior is computed here by quadrature. The second draws the effects of eight schools at random, and the posterior of
their mean and standard deviation is that of the posteriordb, from tests/posteriordb/data.
Prints a table in Markdown; finished runs in FOLDER are used again. Needs no package.
"""

import argparse
import json
import math
import subprocess
import tempfile
from pathlib import Path

UNIFORM = """[study]
title = "A uniform effect"
seed = 1

[[parameter]]
name = "location"
prior = { uniform = [-2.0, 2.0] }

[response]
name = "y"
axes = { place = { values = [1, 2], unit = "1" } }

[model]
use = "equations"
seed = "seed"
observe = "location + 2 * (seed / 2147483648 - 0.5)"

[measurements]
use = "csv"
path = "data.csv"

[validate]
rerun_model = false
"""

PAIRS = [(0.9, 1.2), (-0.4, -0.1), (0.3, 0.8), (0.2, -0.3)]
NOISE = 0.3


def exact():
    """Mean and standard deviation of the location: the uniform number integrated out, the location by the midpoint rule."""
    own = NOISE / math.sqrt(2)
    sums = [0.0, 0.0, 0.0]
    for k in range(20000):
        x = -2 + 4 * (k + 0.5) / 20000
        weight = 1.0
        for pair in PAIRS:
            at = lambda edge: math.erf((sum(pair) / 2 - x + edge) / own / math.sqrt(2))
            weight *= at(1) - at(-1)
        sums = [total + weight * x**power for power, total in enumerate(sums)]
    mean = sums[1] / sums[0]
    return mean, math.sqrt(sums[2] / sums[0] - mean * mean)


REFERENCE = "tests/posteriordb/data/eight_schools-eight_schools_noncentered.json"

MODEL = """import random


def effects(mu, tau, seed):
    own = random.Random(int(seed))
    return [mu + tau * own.gauss(0, 1) for _ in range(8)]
"""

STUDY = """[study]
title = "Eight schools"
seed = 1

[[parameter]]
name = "mu"
prior = { normal = [0, 5] }

[[parameter]]
name = "tau"
prior = { half_student_t = [1, 5] }

[response]
name = "effect"
axes = { school = ["1", "2", "3", "4", "5", "6", "7", "8"] }

[model]
use = "python"
file = "effects.py"
function = "effects"
seed = "seed"

[measurements]
use = "csv"
path = "data.csv"

[validate]
rerun_model = false
"""


def discrepancies(sigma):
    noise = f'variance = {{ known = {[s * s for s in sigma]} }}\nby = "school"\n'
    marginal = '[discrepancy]\nuse = "pseudo_marginal"\n' + noise
    synthetic = '[discrepancy]\nuse = "synthetic_likelihood"\n' + noise
    by_school = 'independent_by = "school"\n'
    made = {f"pseudo_marginal, {runs} runs": marginal + f"simulations = {runs}\n" for runs in (1, 3, 10, 30)}
    made |= {f"the same by school, {runs} runs": marginal + by_school + f"simulations = {runs}\n" for runs in (1, 3)}
    return made | {f"synthetic_likelihood, {runs} runs": synthetic + f"simulations = {runs}\n" for runs in (15, 30)}


def told(folder):
    outcome = json.loads((folder / "run" / "5-calibrate" / "outcome.json").read_text())
    return outcome["estimate"], outcome["evaluations"]


def run(program, folder, text, data):
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "effects.py").write_text(MODEL)
    (folder / "data.csv").write_text(data)
    (folder / "study.toml").write_text(text)
    if not (folder / "run" / "summary.json").exists():
        command = [program, "run", "study.toml", "--out", "run", "--threads", "1"]
        ran = subprocess.run(command, cwd=folder, capture_output=True, text=True)
        if not (folder / "run" / "summary.json").exists():
            raise SystemExit(ran.stdout[-2000:] + ran.stderr[-2000:])
    return json.loads((folder / "run" / "summary.json").read_text())


def row(name, program, folder, text, data, parameters):
    summary = run(program, folder / name.replace(",", "").replace(" ", "-"), text, data)
    estimate, evaluations = told(folder / name.replace(",", "").replace(" ", "-"))
    cells, least = [], math.inf
    for parameter in parameters:
        found = summary["parameters"][parameter]
        error = found["sd"] / found["ess_bulk"] ** 0.5
        cells.append(f"{found['mean']:.3f} ± {error:.3f}, {found['sd']:.3f}")
        least = min(least, found["ess_bulk"])
    cells.append("infinite" if estimate["variance"] is None else f"{estimate['variance']:.2g}")
    cells.append(f"{100 * estimate['longest_stay']:.2g} %")
    cells.append(f"{1000 * least / (evaluations * estimate['runs']):.2g}")
    print(f"| {name} | " + " | ".join(cells) + " |", flush=True)


def head(parameters):
    names = [f"`{name}`: mean, sd" for name in parameters]
    columns = ["", *names, "variance of the estimate", "longest stay", "draws per 1000 runs"]
    print("| " + " | ".join(columns) + " |\n|" + "---|" * len(columns))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("lacuna")
    parser.add_argument("--out", type=Path)
    parser.add_argument("--steps", type=int, default=10000)
    asked = parser.parse_args()
    sampler = f'[sampler]\nuse = "adaptive_metropolis"\nchains = 4\nsteps = {asked.steps}\n'
    published = json.loads((Path(__file__).resolve().parent.parent / REFERENCE).read_text())
    program = str(Path(asked.lacuna).resolve())
    with tempfile.TemporaryDirectory() as temporary:
        folder = (asked.out or Path(temporary)).resolve()
        data = "replicate,place,y\n" + "".join(f"{k},1,{a}\n{k},2,{b}\n" for k, (a, b) in enumerate(PAIRS))
        head(["location"])
        mean, sd = exact()
        print(f"| exact | {mean:.3f}, {sd:.3f} | | | |")
        for runs in (1, 2, 5, 10, 20, 50, 100):
            own = f'[discrepancy]\nuse = "pseudo_marginal"\nvariance = {{ known = {NOISE**2} }}\nsimulations = {runs}\n'
            row(f"{runs} runs", program, folder / "uniform", "\n".join([UNIFORM, own, sampler]), data, ["location"])
        print()
        head(["mu", "tau"])
        cells = [published["reference"][name][key] for name in ("mu", "tau") for key in ("mean", "sd")]
        print("| posteriordb | {:.3f}, {:.3f} | {:.3f}, {:.3f} | | | |".format(*cells))
        sigma, values = published["data"]["sigma"], published["data"]["y"]
        data = "school,effect\n" + "".join(f"{k + 1},{y}\n" for k, y in enumerate(values))
        for name, own in discrepancies(sigma).items():
            row(name, program, folder / "schools", "\n".join([STUDY, own, sampler]), data, ["mu", "tau"])


if __name__ == "__main__":
    main()
