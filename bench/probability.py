"""Fit of the probability that a name of the gap workflow is right, to counts in worlds that share no code with the engine.

    python bench/probability.py [--worlds COMMAND] [--single COMMAND] [--cases 60] [--records 164] [--seed 1] [--out FOLDER]
                                [--check SEED] [--write]

Draws up to CASES random cases in each of two worlds of `bench/src/bin/worlds` (a box of liquid, a pipe), without a companion and with one,
and RECORDS single records of `bench/src/bin/records`, runs the search on them, and fits a logistic regression of *the class of an effect holds the type that is hidden* on the quantities of `Traits` in
`core/engine/src/gap/search/verdict/probability.rs`; `--write` puts the coefficients there. Lines of finished cases in FOLDER are
reused, also those of an interrupted run. Cases whose cause the library has (a fault of the measuring chain, a term of the equations) have half of the
weight, cases with physics of another form the other half. No slope may be negative: what would be is left out.

Prints the shares that were right by told probability, for the posterior probability and for the fitted one, within the cases of the fit by
ten-fold cross-validation, and with `--check SEED` in further cases that the fit has not seen. Needs only Python.
"""

import argparse
import math
import os
import random
import re
import subprocess

HERE = os.path.dirname(os.path.abspath(__file__))
TARGET = os.path.join(HERE, "..", "core", "engine", "src", "gap", "search", "verdict", "probability.rs")
# The worlds without a companion and with one, and the numbers of cases.
WORLDS = (("box", 60), ("pipe", 60), ("box --companion", 40), ("pipe --companion", 40))
EDGES = (0.0, 0.2, 0.4, 0.6, 0.8, 0.9, 1.0)
FLOOR, CEILING = 0.01, 0.99
NAMES = ("log_odds", "local", "transfer", "closed", "inexact")
# A weak normal prior, for few cases: every quantity is evidence for the name, by a slope of 2 +- 2 over its range of about one, and
# without any evidence a name is improbable. A hundred cases outweigh it.
PRIOR_SLOPE, PRIOR_INTERCEPT = (2.0, 2.0), (-5.0, 3.0)

FAULTS = {"LowPass": "low_pass", "SecondaryPulse": "secondary_pulse", "PulseHeating": "pulse_heating", "LevelJump": "level_jumps"}
# Physics inside the simulators: the types that are the physics itself, of the library or of a companion, and the listed types near to
# it, which are right unless they are named as if they were exact. A companion has its candidates beside the places where the physics is.
INSIDE = {
    "damping everywhere": ({"damping"}, set()),
    "damping in the rear": ({"damping", "damping_rear"}, {"damping_last"}),
    "screen": ({"screen_2"}, set()),
    "gas in the rear": ({"gas_last", "gas_rear"}, set()),
    "rigid rear wall": ({"rear_stiffness"}, set()),
    "late cavities": ({"late_cavities"}, set()),
    "moved gauge": ({"crosstalk", "misplacement"}, set()),
    "quadratic friction": ({"square_friction"}, {"damping"}),
    "leak": ({"leak", "leak_3"}, set()),
    "blockage": ({"throttle", "throttle_2"}, set()),
    "air": ({"air", "air_2", "air_3"}, set()),
    "creep": ({"creep"}, set()),
    "leaking valve": ({"valve_leak"}, set()),
    "unsteady friction": ({"unsteady_friction"}, {"damping", "linear_friction"}),
    "exponent of the friction": ({"friction_power"}, {"damping", "linear_friction"}),
    "stratified helium": ({"void_fraction"}, {"gas_attenuation"}),
    "late bubbles": ({"void_fraction"}, {"gas_attenuation"}),
    "damping": ({"damping"}, set()),
    "reflecting rear end": ({"rear_reflection"}, {"echo"}),
    "late closing": (set(), {"secondary_pulse"}),
    "beam beside the axis": (set(), {"beam_width", "pulse_energy"}),
    "thick cylinder": (set(), {"wall_thickness"}),
    "soft steel": (set(), {"wall_thickness"}),
    "deeper deposition": (set(), {"pulse_energy"}),
}


class Effect:
    """One effect that was found: its quantities, whether it is right, and the case."""

    def __init__(self, traits, right, case, outside):
        self.traits, self.right, self.case, self.outside, self.weight = traits, right, case, outside, 1.0

    def posterior(self):
        return logistic(self.traits[0])

    def scaled(self):
        log_odds, local, transfer, closed, inexact = self.traits
        within = lambda x, low, high: min(max(x, low), high)
        return [within(log_odds, -5, 10) / 10, within(local, 0, 1), within(transfer, -5, 10) / 10, within(closed, 0, 1),
                -math.log1p(within(inexact, 0, 100)) / 5]


def logistic(x):
    return 1 / (1 + math.exp(-x)) if x > -700 else 0.0


def finished(path, columns):
    """The lines of finished cases in a file."""
    if not os.path.exists(path):
        return []
    with open(path) as file:
        return [line for line in file.read().split("\n")[:-1] if line.count("\t") >= columns]


def made(path, have, command, is_case):
    """The lines of finished cases and those that a command prints, which are added to the file as they come."""
    with open(path, "w") as file:
        file.writelines(line + "\n" for line in have)
        file.flush()
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
            for line in filter(is_case, process.stdout):
                have.append(line.rstrip("\n"))
                file.write(line)
                file.flush()
    return have


def collected(options, seed):
    """The lines of the cases of a seed in the worlds, made where they are missing."""
    lines = []
    for world, count in WORLDS:
        count = min(count, options.cases)
        path = os.path.join(options.out, f"{world.replace(' --', '-')}-{seed}.tsv")
        have = finished(path, 8)
        done = {int(line.split("\t")[1]) % 10000 for line in have}
        missing = [i for i in range(count) if i not in done]
        if missing and not options.reuse:
            command = options.worlds.split() + world.split() + ["--random", str(count), "--seed", str(seed), "--only",
                                                                ",".join(map(str, missing))]
            have = made(path, have, command, lambda line: line.startswith(world.split()[0] + "\t"))
        lines += have
    return lines


def collected_records(options, seed):
    """The lines of the single records of a seed, made where they are missing."""
    path = os.path.join(options.out, f"records-{seed}.tsv")
    have = [line for line in finished(path, 17) if line[0].isdigit()]
    done = {int(line.split("\t")[0]) for line in have}
    missing = [i for i in range(options.records) if i not in done]
    if missing and not options.reuse:
        command = options.single.split() + ["--seed", str(seed), "--only", ",".join(map(str, missing))]
        have = made(path, have, command, lambda line: line[0].isdigit())
    return have


def read(lines, records):
    """The effects of all cases, and the numbers of cases whose cause has a form of the library, and another one."""
    effects, counts = [], [0, 0]
    for line in records:
        values = line.split("\t")
        if values[3] == "nothing" and not values[17]:
            continue
        outside = values[3] == "outside"
        counts[outside] += 1
        for right, *traits in (text.split() for text in values[17].split(" & ") if text):
            effects.append(Effect(tuple(map(float, traits)), right == "1", ("record", values[0]), outside))
    for line in lines:
        world, seed, _, hidden, _, word, _, _, _, *found = line.split("\t")
        causes = hidden.split(" & ")
        outside = any(cause.startswith("inside:") for cause in causes)
        counts[outside] += 1
        for text in found:
            name, _, _, traits = text.split(";")
            types = name.split("@")[0].split("/")
            traits = tuple(map(float, traits.split(" ")))
            right = any(is_right(cause, word, types) for cause in causes)
            effects.append(Effect(traits, right, (world, seed), outside))
    for effect in effects:
        effect.weight = 0.5 * sum(counts) / max(counts[effect.outside], 1)
    return effects, counts


def is_right(cause, word, types):
    if cause.startswith("inside:"):
        itself, near = INSIDE.get(cause[len("inside:"):], (set(), set()))
        return bool(itself & set(types)) or word != "Named" and bool(near & set(types))
    kind = cause.split("@")[0]
    return FAULTS.get(kind, kind.lower()) in types


def solved(matrix, right):
    """The solution of a small system, by elimination with pivots."""
    n = len(right)
    rows = [list(row) + [value] for row, value in zip(matrix, right)]
    for k in range(n):
        pivot = max(range(k, n), key=lambda i: abs(rows[i][k]))
        rows[k], rows[pivot] = rows[pivot], rows[k]
        for i in range(k + 1, n):
            factor = rows[i][k] / rows[k][k]
            rows[i] = [a - factor * b for a, b in zip(rows[i], rows[k])]
    x = [0.0] * n
    for k in reversed(range(n)):
        x[k] = (rows[k][n] - sum(rows[k][j] * x[j] for j in range(k + 1, n))) / rows[k][k]
    return x


def regression(effects, used):
    """Intercept and slopes of the used quantities, by Newton's method."""
    x = [[1.0] + [effect.scaled()[j] for j in used] for effect in effects]
    prior = [PRIOR_INTERCEPT] + [PRIOR_SLOPE] * len(used)
    b = [mean for mean, _ in prior]
    for _ in range(60):
        gradient = [(mean - value) / sd ** 2 for value, (mean, sd) in zip(b, prior)]
        hessian = [[(i == j) / sd ** 2 for j in range(len(b))] for i, (_, sd) in enumerate(prior)]
        for row, effect in zip(x, effects):
            p = logistic(sum(a * c for a, c in zip(row, b)))
            for i, a in enumerate(row):
                gradient[i] += effect.weight * (effect.right - p) * a
                for j, c in enumerate(row):
                    hessian[i][j] += effect.weight * p * (1 - p) * a * c
        step = solved(hessian, gradient)
        b = [value + min(max(move, -2), 2) for value, move in zip(b, step)]
        if max(map(abs, step)) < 1e-9:
            break
    return b


def fitted(effects):
    """Intercept and the slopes of all quantities, none of which is negative."""
    used = list(range(len(NAMES)))
    while True:
        b = regression(effects, used)
        negative = [k for k in range(len(used)) if b[k + 1] < 0]
        if not negative:
            slopes = [0.0] * len(NAMES)
            for j, value in zip(used, b[1:]):
                slopes[j] = value
            return b[0], slopes
        worst = min(negative, key=lambda k: b[k + 1])
        used.pop(worst)


def told(fit, effect):
    intercept, slopes = fit
    p = logistic(intercept + sum(a * b for a, b in zip(slopes, effect.scaled())))
    return min(max(p, FLOOR), CEILING)


def cross_validated(effects):
    """The probability of each effect by a fit to nine tenths of the cases, of which its own is none."""
    cases = sorted({effect.case for effect in effects})
    random.Random(1).shuffle(cases)
    fold = {case: i % 10 for i, case in enumerate(cases)}
    fits = [fitted([e for e in effects if fold[e.case] != k]) for k in range(10)]
    return [told(fits[fold[e.case]], e) for e in effects]


def table(title, effects, probabilities):
    """The shares that were right by told probability, and the weighted scores."""
    weight = sum(e.weight for e in effects)
    brier = sum(e.weight * (p - e.right) ** 2 for e, p in zip(effects, probabilities)) / weight
    clipped = [min(max(p, 1e-3), 1 - 1e-3) for p in probabilities]
    score = sum(e.weight * math.log(p if e.right else 1 - p) for e, p in zip(effects, clipped)) / weight
    print(f"{title}: {len(effects)} names, Brier score {brier:.3f}, mean log score {score:.3f}")
    for low, high in zip(EDGES, EDGES[1:]):
        own = [(e, p) for e, p in zip(effects, probabilities) if low <= p < high or p == high == 1.0]
        if own:
            all_of = sum(e.weight for e, _ in own)
            mean = sum(e.weight * p for e, p in own) / all_of
            share = sum(e.weight * e.right for e, _ in own) / all_of
            print(f"  {low:.1f} to {high:.1f}: {len(own):3} names, {sum(e.right for e, _ in own):3} right; told {mean:.2f}, "
                  f"weighted share {share:.2f}")


def written(fit, effects, counts, options):
    """The constant in the source."""
    intercept, slopes = fit
    part = "" if not options.reuse else "the first of "
    doc = (f"/// The fit to {len(effects)} names of {sum(counts)} cases of the worlds and the single records in `tests/generator`, {counts[1]} of them\n"
           f"/// with physics that no candidate has exactly: {part}those of\n"
           f"/// `python bench/probability.py --cases {options.cases} --records {options.records} --seed {options.seed} --write`.\n")
    values = ", ".join(f"{slope:.3f}" for slope in slopes)
    constant = f"const FITTED: Regression =\n    Regression {{ intercept: {intercept:.3f}, slopes: [{values}] }};\n"
    with open(TARGET) as file:
        source = file.read()
    source, count = re.subn(r"(///[^\n]*\n)+const FITTED: Regression =\s+Regression \{[^}]*\};\n", lambda _: doc + constant, source)
    if count != 1:
        raise SystemExit(f"{TARGET} has no constant FITTED")
    with open(TARGET, "w") as file:
        file.write(source)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--worlds", default="cargo run --release -p lacuna-bench --bin worlds --")
    parser.add_argument("--single", default="cargo run --release -p lacuna-bench --bin records --")
    parser.add_argument("--cases", type=int, default=60)
    parser.add_argument("--records", type=int, default=164)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--check", type=int)
    parser.add_argument("--out", default="target/probability")
    parser.add_argument("--reuse", action="store_true", help="take the finished cases alone")
    parser.add_argument("--write", action="store_true")
    options = parser.parse_args()
    os.makedirs(options.out, exist_ok=True)
    effects, counts = read(collected(options, options.seed), collected_records(options, options.seed))
    print(f"{sum(counts)} cases, {counts[1]} with physics of another form, {len(effects)} names")
    table("posterior", effects, [e.posterior() for e in effects])
    fit = fitted(effects)
    print("intercept %.3f, slopes %s" % (fit[0], ", ".join(f"{n} {s:.3f}" for n, s in zip(NAMES, fit[1]))))
    table("fitted", effects, [told(fit, e) for e in effects])
    table("fitted, cross-validated", effects, cross_validated(effects))
    if options.write:
        written(fit, effects, counts, options)
    if options.check is not None:
        further, counts = read(collected(options, options.check), collected_records(options, options.check))
        print(f"further cases: {sum(counts)}, {counts[1]} with physics of another form")
        table("posterior", further, [e.posterior() for e in further])
        table("fitted before", further, [told(fit, e) for e in further])


if __name__ == "__main__":
    main()
