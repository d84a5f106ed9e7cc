"""Eight schools with random effects from a simulator: the second table of stochastic simulators in docs/model_error.md.

    python bench/stochastic.py LACUNA [--out FOLDER]

LACUNA is the program. The model draws the effects of the eight schools at random; the program sees only its responses.
The posterior of mean and standard deviation of the effects is that of the posteriordb, from tests/truth/posteriordb/data.
Prints a table in Markdown; finished runs in FOLDER are used again. Needs no package.
"""

import argparse
import json
import subprocess
import tempfile
from pathlib import Path

REFERENCE = "tests/truth/posteriordb/data/eight_schools-eight_schools_noncentered.json"

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
path = "effects.csv"

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


def fact(folder, name):
    outcome = json.loads((folder / "run" / "5-calibrate" / "outcome.json").read_text())
    return outcome["estimate"], outcome["evaluations"]


def run(program, folder, text, data):
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "effects.py").write_text(MODEL)
    (folder / "effects.csv").write_text(data)
    (folder / "study.toml").write_text(text)
    if not (folder / "run" / "summary.json").exists():
        command = [program, "run", "study.toml", "--out", "run", "--threads", "1"]
        ran = subprocess.run(command, cwd=folder, capture_output=True, text=True)
        if not (folder / "run" / "summary.json").exists():
            raise SystemExit(ran.stdout[-2000:] + ran.stderr[-2000:])
    return json.loads((folder / "run" / "summary.json").read_text())


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("lacuna")
    parser.add_argument("--out", type=Path)
    parser.add_argument("--steps", type=int, default=20000)
    asked = parser.parse_args()
    root = Path(__file__).resolve().parent.parent
    published = json.loads((root / REFERENCE).read_text())
    sigma, values = published["data"]["sigma"], published["data"]["y"]
    data = "school,effect\n" + "".join(f"{k + 1},{y}\n" for k, y in enumerate(values))
    sampler = f'[sampler]\nuse = "adaptive_metropolis"\nchains = 4\nsteps = {asked.steps}\n'
    print("| | `mu`: mean, sd | `tau`: mean, sd | variance of the estimate | longest stay | draws per 1000 runs |")
    print("|---|---|---|---|---|---|")
    cells = [f"{published['reference'][name][key]:.2f}" for name in ("mu", "tau") for key in ("mean", "sd")]
    print(f"| posteriordb | {cells[0]}, {cells[1]} | {cells[2]}, {cells[3]} | | | |")
    with tempfile.TemporaryDirectory() as temporary:
        folder = (asked.out or Path(temporary)).resolve()
        for name, discrepancy in discrepancies(sigma).items():
            own = folder / name.replace(",", "").replace(" ", "-")
            summary = run(str(Path(asked.lacuna).resolve()), own, STUDY + "\n" + discrepancy + "\n" + sampler, data)
            estimate, evaluations = fact(own, name)
            cells, least = [], float("inf")
            for parameter in ("mu", "tau"):
                found = summary["parameters"][parameter]
                error = found["sd"] / found["ess_bulk"] ** 0.5
                cells.append(f"{found['mean']:.2f} ± {error:.2f}, {found['sd']:.2f}")
                least = min(least, found["ess_bulk"])
            cells.append(f"{estimate['variance']:.2g}")
            cells.append(f"{100 * estimate['longest_stay']:.2g} %")
            cells.append(f"{1000 * least / (evaluations * estimate['runs']):.2g}")
            print(f"| {name} | " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
