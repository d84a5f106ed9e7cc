"""Reliability methods of Lacuna and of OpenTURNS on the same limit states: calls of the model and relative errors.

    python bench/reliability.py [--table FILE]

Needs `pip install openturns`. The methods of Lacuna run in the test `reliability::tests::table` of the plugins, whose output
may be given as a file. OpenTURNS gets the same coefficient of variation of 5 % for importance sampling, and the same
number of samples per level for subset simulation. Prints a table in Markdown.
"""

import argparse
import math
import os
import re
import subprocess
from collections import defaultdict

import openturns as ot

R = "sqrt(2)"


def branches(k):
    return (
        f"min(min(3+0.1*(x0-x1)^2-(x0+x1)/{R}, 3+0.1*(x0-x1)^2+(x0+x1)/{R}),"
        f" min(x0-x1+{k}/{R}, x1-x0+{k}/{R}))"
    )


def normals(d):
    return [ot.Normal(0, 1)] * d


def log_normals():
    moments = [(120, 12)] * 4 + [(50, 10), (40, 8)]
    return [ot.ParametrizedDistribution(ot.LogNormalMuSigma(m, s, 0.0)) for m, s in moments]


SUM10 = "+".join(f"x{i}" for i in range(10))
SUM100 = "+".join(f"x{i}" for i in range(100))
SQUARES = "+".join(f"x{i}^2" for i in range(1, 100))
FOUR = "+".join(f"x{i}^2" for i in range(4))
BETA = "4.753424308822899"

PROBLEMS = {
    "four-branch, k = 7": (branches(7), normals(2), 2.22279506619444e-3),
    "four-branch, k = 6": (branches(6), normals(2), 4.457331490626487e-3),
    "RP8": ("x0+2*x1+2*x2+x3-5*x4-5*x5", log_normals(), 7.88888998e-4),
    "RP22": (f"2.5-(x0+x1)/{R}+0.1*(x0-x1)^2", normals(2), 4.2073055113e-3),
    "RP24": ("2.5-0.7071*(x0-x1)+0.00463*(3*(x0+x1))^4", normals(2), 2.8599456875e-3),
    "RP28": ("x0*x1-146.14", [ot.Normal(78064, 11710), ot.Normal(0.0104, 0.00156)], 1.4530890761e-7),
    "RP31": ("2-x1+256*x0^4", normals(2), 3.2266812096e-3),
    "RP33": ("min(3*sqrt(3)-x0-x1-x2, 3-x2)", normals(3), 2.5755977908e-3),
    "RP53": (
        "sin(2.5*x0)+2-(x0*x0+4)*(x1-1)/20",
        [ot.Normal(1.5, 1), ot.Normal(2.5, 1)],
        3.1320485687e-2,
    ),
    "RP63": (f"0.1*({SQUARES})-x0-4.5", normals(100), 3.7694361183e-4),
    "RP75": ("3-x0*x1", normals(2), 9.8192987215e-3),
    "RP107": (f"5*sqrt(10)-({SUM10})", normals(10), 2.8665157188e-7),
    "RP111": ("12.5-abs(x0*x1)", normals(2), 8.035085965e-7),
    "plane, 2 variables": (f"{BETA}-(x0+x1)/{R}", normals(2), 1e-6),
    "plane, 100 variables": (f"{BETA}-({SUM100})/10", normals(100), 1e-6),
    "paraboloid": (f"4-x4+0.05*({FOUR})", normals(5), 1.543384736997529e-5),
}
SEEDS = 5


def event(formula, marginals):
    names = [f"x{i}" for i in range(len(marginals))]
    symbolic = ot.SymbolicFunction(names, [formula])
    calls = [0]

    def counted(points):
        calls[0] += len(points)
        return symbolic(points)

    function = ot.PythonFunction(len(names), 1, func_sample=counted)
    distribution = ot.JointDistribution(marginals)
    output = ot.CompositeRandomVector(function, ot.RandomVector(distribution))
    return calls, distribution, ot.ThresholdEvent(output, ot.LessOrEqual(), 0.0)


def form(distribution, rare):
    solver = ot.AbdoRackwitz()
    solver.setCheckStatus(False)
    algorithm = ot.FORM(solver, rare, distribution.getMean())
    algorithm.run()
    return algorithm.getResult()


def with_seed(method, calls, distribution, rare):
    if method == "form":
        probability = form(distribution, rare).getEventProbability()
    elif method == "importance_sampling":
        algorithm = ot.PostAnalyticalImportanceSampling(form(distribution, rare))
        algorithm.setMaximumCoefficientOfVariation(0.05)
        algorithm.setMaximumOuterSampling(100)
        algorithm.setBlockSize(100)
        algorithm.run()
        probability = algorithm.getResult().getProbabilityEstimate()
    else:
        algorithm = ot.SubsetSampling(rare)
        algorithm.setMaximumOuterSampling(20)
        algorithm.setBlockSize(100)
        algorithm.setConditionalProbability(0.1)
        algorithm.run()
        probability = algorithm.getResult().getProbabilityEstimate()
    return calls[0], probability


def openturns():
    found = defaultdict(list)
    for name, (formula, marginals, reference) in PROBLEMS.items():
        for method in ["form", "importance_sampling", "subset_simulation"]:
            for seed in range(1 if method == "form" else SEEDS):
                ot.RandomGenerator.SetSeed(seed)
                try:
                    calls, p = with_seed(method, *event(formula, marginals))
                except Exception as error:  # a search that ends without a point is a result of the comparison
                    print(f"<!-- {method} {name}: {str(error).splitlines()[0][:90]} -->")
                    continue
                found[method, name].append((calls, p / reference - 1))
    return found


LINE = re.compile(r"^(\w+) +(\S.*?) +(\d+) +(\d+) calls +(\S+) error +(\S+) cov", re.M)


def lacuna(path):
    if path:
        text = open(path).read()
    else:
        command = "cargo test -p lacuna-plugins --lib reliability::tests::table -- --nocapture"
        whole = os.environ | {"LACUNA_RELIABILITY": "1"}
        ran = subprocess.run(command.split(), capture_output=True, text=True, check=True, env=whole)
        text = ran.stdout
    found = defaultdict(list)
    for method, name, _, calls, _, error in LINE.findall(text.replace("... form", "...\nform")):
        found[method, name].append((int(calls), float(error)))
    return found


def cell(runs):
    if not runs:
        return "-"
    calls = sum(c for c, _ in runs) / len(runs)
    error = math.sqrt(sum(e * e for _, e in runs) / len(runs))
    return f"{calls:.0f}, {100 * error:.1f} %" if error < 10 else f"{calls:.0f}, fails"


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--table", help="output of the test, if it has been run")
    ours, theirs = lacuna(parser.parse_args().table), openturns()
    columns = [("form", 1), ("form", 0), ("sorm", 0), ("importance_sampling", 1), ("importance_sampling", 0)]
    columns += [("subset_simulation", 1), ("subset_simulation", 0), ("active_kriging", 0)]
    heads = [f"{method} ({'OpenTURNS' if other else 'Lacuna'})" for method, other in columns]
    print("| problem | " + " | ".join(heads) + " |")
    print("|---" * (len(heads) + 1) + "|")
    for name in PROBLEMS:
        cells = [cell((theirs if other else ours)[method, name]) for method, other in columns]
        print(f"| {name} | " + " | ".join(cells) + " |")


if __name__ == "__main__":
    main()
