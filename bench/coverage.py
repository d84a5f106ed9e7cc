"""Coverage of the intervals of `lacuna coverage`, over several designs.

    python bench/coverage.py [--lacuna PATH] [--out FOLDER] [--designs 8] [--truths 25] [--margin 0] [CASE ...]

A case is STUDY:SURROGATE:RUNS with a study of `bench/coverage`, a surrogate of the list below and the number of simulation runs;
without cases, all those of the table in docs/coverage.md are run. Every design has its own truths and data; the model itself is calibrated
to the same data. Prints for every case the coverage of the central intervals of 50, 90 and 95 %, that of the 95 % interval at an edge of
the prior (in brackets the expected coverage of a correct posterior) and elsewhere, the largest error in posterior standard deviations, the
median over cases of the ratio of the posterior standard deviation to that of the model itself, and the seconds per truth. Before these, the
99 % bands of the coverage of correct intervals, for the number of truths of one unknown. Needs only Python; finished cases are reused.
"""

import argparse
import json
import math
import os
import statistics
import subprocess
import time
import tomllib

SURROGATES = {
    "pce": ["surrogate.use=polynomial_chaos", "surrogate.degree.max=12"],
    "pce3": ["surrogate.use=polynomial_chaos", "surrogate.degree.max=3"],
    "gp": ["surrogate.use=gaussian_process"],
}
CASES = [f"{study}:{kind}:{runs}" for study in ("oscillator", "front") for kind, runs in
         (("pce3", 24), ("gp", 24), ("pce", 150), ("gp", 150))]
HERE = os.path.join(os.path.dirname(os.path.abspath(__file__)), "coverage")
EXACT = ["design=false", "surrogate=false"]


def counted(options, study, settings, name, seed):
    """Cases of one design, and their run time in seconds."""
    folder = os.path.join(options.out, name, str(seed))
    took = os.path.join(folder, "seconds")
    if not os.path.exists(took):
        settings = settings + [f"study.seed={seed}"]
        command = [options.lacuna, "coverage", os.path.join(HERE, f"{study}.toml"), "--out", folder,
                   "--noise", "posterior", "--count", str(options.truths)]
        start = time.time()
        subprocess.run(command + [word for s in settings for word in ("--set", s)], check=True, stdout=subprocess.DEVNULL)
        with open(took, "w") as file:
            file.write(str(time.time() - start))
    with open(os.path.join(folder, "7-coverage", "cases.json")) as file:
        found = json.load(file)["cases"]
    with open(took) as file:
        return found, float(file.read())


def band(n, p):
    """99 % band, in per cent, of the coverage of n independent truths by intervals of probability p."""
    log = lambda k: math.lgamma(n + 1) - math.lgamma(k + 1) - math.lgamma(n - k + 1) + k * math.log(p) + (n - k) * math.log(1 - p)
    low, below = 0, math.exp(log(0))
    while below < 0.005:
        low += 1
        below += math.exp(log(low))
    high, above = n, math.exp(log(n))
    while above < 0.005:
        high -= 1
        above += math.exp(log(high))
    return 100 * low / n, 100 * high / n


def cases(found):
    """Unknowns of the study's parameters by case number, for calibrations that gave a posterior."""
    ended = {case["case"]["number"]: case["case"]["ended"] for case in found}
    return {number: e["calibrated"]["unknowns"] for number, e in ended.items() if "calibrated" in e}


def row(options, case):
    """Computes the line of one case."""
    study, kind, runs = case.split(":")
    with open(os.path.join(HERE, f"{study}.toml"), "rb") as file:
        priors = [p["prior"]["uniform"] for p in tomllib.load(file)["parameter"]]
    held, edge, within, expected, errors, widths, seconds, truths, failed = [], [], [], [], [], [], 0.0, 0, 0
    for seed in range(1, options.designs + 1):
        settings, name = SURROGATES[kind] + [f"design.runs={runs}"], case.replace(":", "-")
        if options.margin > 0:
            settings, name = settings + [f"design.margin={options.margin}"], f"{name}-margin-{options.margin}"
        emulated, took = counted(options, study, settings, name, seed)
        exact = cases(counted(options, study, EXACT, f"{study}-exact", seed)[0])
        seconds += took
        truths += options.truths
        calibrated = cases(emulated)
        failed += options.truths - len(calibrated)
        for number, unknowns in calibrated.items():
            for j, ((low, high), u) in enumerate(zip(priors, unknowns)):
                holds = [a <= u["truth"] <= b for a, b in u["intervals"]]
                held.append(holds)
                inside = 0.1 <= (u["truth"] - low) / (high - low) <= 0.9
                (within if inside else edge).append(holds[2])
                if not inside:
                    expected.append(u)
                errors.append(abs(u["truth"] - u["mean"]) / u["sd"])
                if number in exact:
                    widths.append(u["sd"] / exact[number][j]["sd"])
    share = lambda values: 100 * sum(values) / len(values)
    right = 100 * sum(u["edge_inside"][2] for u in expected) / sum(u["edge"] for u in expected)
    levels = " / ".join(f"{share([h[k] for h in held]):.1f}" for k in range(3))
    return (f"| {study}, {kind}, {runs} runs | {truths} x {len(priors)} | {levels} | {share(edge):.1f} ({right:.1f}) / {share(within):.1f} | "
            f"{max(errors):.1f} | {statistics.median(widths):.2f} | {seconds / truths:.1f} | {failed} |")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--lacuna", default="target/release/lacuna")
    parser.add_argument("--out", default="target/coverage")
    parser.add_argument("--designs", type=int, default=8)
    parser.add_argument("--truths", type=int, default=25)
    parser.add_argument("--margin", type=float, default=0.0, help="of the design beyond the prior")
    parser.add_argument("cases", nargs="*", default=CASES)
    options = parser.parse_args()
    bands = [band(options.designs * options.truths, p) for p in (0.5, 0.9, 0.95)]
    print("bands: " + ", ".join(f"{low:.1f} to {high:.1f}" for low, high in bands), flush=True)
    print("| case | truths | 50 / 90 / 95 % | 95 % at edges (right) / elsewhere | largest error | width | s a truth | failed |")
    print("|---|---|---|---|---|---|---|---|", flush=True)
    for case in options.cases or CASES:
        print(row(options, case), flush=True)


if __name__ == "__main__":
    main()
