"""Coverage of predictions by each description of model error: the tables of docs/model_error.md.

    python bench/model_error.py LACUNA [--case CASE ...] [--sets N] [--only VARIANT ...] [--out FOLDER]

LACUNA is the program. Needs NumPy and SciPy. Each case is a published problem whose data come from here: the truth, the
noise and the seeds do not depend on the program. For every variant of a study the program runs on N data sets, and the
table has, for each number, how many 95 % intervals contain the truth, the mean of the intervals' widths, and the mean of
the estimates. Prints tables in Markdown; finished runs in FOLDER are used again.
"""

import argparse
import json
import subprocess
import tempfile
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Callable

import numpy as np
from scipy.stats import norm

ENSEMBLE = '[sampler]\nuse = "affine_invariant_ensemble"\nwalkers = {walkers}\nsteps = {steps}\n'
NO_U_TURN = '[sampler]\nuse = "no_u_turn"\n'
PARTICLES = '[sampler]\nuse = "sequential_monte_carlo"\nparticles = 200\n'


@dataclass
class Case:
    """A problem: its study without discrepancy, effects and sampler, its data, and what it is to predict."""

    # The text, or the text for each data set.
    study: str | Callable[[int], str]
    data: Callable[[int], str]
    # True value of each parameter or quantity for a data set, in the order of the table.
    truth: Callable[[int], dict]
    # Discrepancy, effects and sampler of each variant.
    variants: dict


def discrepancy(name, *options):
    return "\n".join(["[discrepancy]", f'use = "{name}"', *options]) + "\n"


def study(parameters, axis, observe, quantities):
    lines = ['[study]\ntitle = "coverage"\n']
    lines += [f'[[parameter]]\nname = "{name}"\nprior = {prior}\n' for name, prior in parameters.items()]
    lines.append(f'[response]\nname = "y"\naxes = {{ {axis} }}\n\n[model]\nuse = "equations"\nobserve = "{observe}"\n')
    lines.append('[measurements]\nuse = "csv"\npath = "data.csv"\n')
    lines += [f'[[quantity]]\nname = "{name}"\n{options}\n' for name, options in quantities.items()]
    return "\n".join(lines)


def table(columns, *numbers):
    rows = zip(*numbers)
    return "\n".join([columns, *(",".join("" if x is None else f"{x:.10g}" for x in row) for row in rows)]) + "\n"


# The simple machine of Brynjarsdottir and O'Hagan, Inverse Problems 30 (2014) 114007.


def work(effort):
    return 0.65 * effort / (1 + effort / 20)


def machine():
    measured = 0.2 + 0.38 * np.arange(11)

    def data(number):
        y = work(measured) + 0.01 * np.random.default_rng([2014, number]).standard_normal(11)
        return table("effort,y", [*measured, *(0.2 + 0.38 * np.arange(11, 16))], [*y, *[None] * 5])

    process = [
        "bias = { half_normal = 0.5 }",
        "correlation_length = { log_normal = [0.7, 0.7] }",
        "variance = { known = 1e-4 }",
    ]
    at_zero = "known = [{ at = 0.0, value = 0.0, slope = 0.0 }]"
    decreasing = 'monotone = "decreasing"'
    sampler = ENSEMBLE.format(walkers=12, steps=450)
    variants = {
        "gaussian": discrepancy("gaussian", "variance = { known = 1e-4 }"),
        "gaussian_process": discrepancy("gaussian_process", *process),
        "gaussian_process, not orthogonal": discrepancy("gaussian_process", "orthogonal = false", *process),
        "scaled_gaussian_process": discrepancy("scaled_gaussian_process", *process),
        "embedded": discrepancy(
            "embedded", "spread = { efficiency = { half_normal = 0.1 } }", "variance = { known = 1e-4 }"
        ),
        "constrained, value and slope": discrepancy("constrained_gaussian_process", at_zero, *process),
        "constrained, decreasing too": discrepancy("constrained_gaussian_process", at_zero, decreasing, *process),
    }
    text = study(
        {"efficiency": "{ uniform = [0.2, 1.0] }"},
        'effort = { first = 0.2, last = 5.9, count = 16, unit = "1" }',
        "efficiency * effort",
        {"beyond": 'use = "at"\nplace = 5.9'},
    )
    truth = {"efficiency": 0.65, "beyond": work(5.9)}
    return Case(text, data, lambda _: truth, {name: own + sampler for name, own in variants.items()})


# The same with an experiment without losses that measured the efficiency to 0.65 +- 0.02: modular and full Bayes.


def modular():
    measured = 0.2 + 0.38 * np.arange(11)

    def elsewhere(number):
        return 0.65 + 0.02 * np.random.default_rng([2009, number]).standard_normal()

    def data(number):
        y = work(measured) + 0.01 * np.random.default_rng([2014, number]).standard_normal(11)
        return table("effort,y", [*measured, *(0.2 + 0.38 * np.arange(11, 16))], [*y, *[None] * 5])

    def text(number):
        return study(
            {"efficiency": f"{{ normal = [{elsewhere(number):.10g}, 0.02] }}"},
            'effort = { first = 0.2, last = 5.9, count = 16, unit = "1" }',
            "efficiency * effort",
            {"beyond": 'use = "at"\nplace = 5.9'},
        )

    process = [
        "bias = { half_normal = 0.5 }",
        "correlation_length = { log_normal = [0.7, 0.7] }",
        "variance = { known = 1e-4 }",
    ]
    sampler = ENSEMBLE.format(walkers=12, steps=1000)
    free = discrepancy("gaussian", "variance = { half_normal = 0.1 }") + sampler
    known = discrepancy("gaussian", "variance = { known = 1e-4 }") + sampler
    smooth = discrepancy("gaussian_process", "orthogonal = false", *process) + sampler
    variants = {
        "full, gaussian": known,
        "full, gaussian, noise unknown": free,
        "full, gaussian_process, not orthogonal": smooth,
        "cut, gaussian, noise unknown": free,
        "cut, gaussian_process, not orthogonal": smooth,
    }
    truth = {"efficiency": 0.65, "beyond": work(5.9)}
    return Case(text, data, lambda _: truth, variants)


# The same with the efficiency known from elsewhere: the adjustments of Joseph and Melkote, J. Quality Technology 41 (2009) 362.


def adjustments():
    measured = np.round(np.linspace(0.2, 4, 11), 4)

    def data(number):
        y = work(measured) + 0.01 * np.random.default_rng(300 + number).standard_normal(11)
        return table("effort,y", [*measured, 5.9], [*y, None])

    noise = discrepancy("gaussian", "variance = { half_normal = 0.1 }")
    smooth = discrepancy(
        "gaussian_process",
        "variance = { half_normal = 0.1 }",
        "bias = { half_normal = 0.5 }",
        "correlation_length = { log_normal = [0.7, 0.7] }",
        "orthogonal = false",
    )
    offset = '[[effect]]\nuse = "offset"\nsize = { normal = [0, 0.5] }\n'
    gain = '[[effect]]\nuse = "gain"\nfactor = { normal = [1, 0.3] }\n'
    sampler = ENSEMBLE.format(walkers=40, steps=2000)
    variants = {
        "none": noise,
        "constant": noise + offset,
        "constant and scale": noise + gain + offset,
        "smooth function": smooth,
        "all three": smooth + gain + offset,
    }
    grid = ", ".join(f"{x:.10g}" for x in [*measured, 5.9])
    text = study(
        {"efficiency": "{ normal = [0.65, 0.005] }"},
        f'effort = {{ values = [{grid}], unit = "1" }}',
        "efficiency * effort",
        {"beyond": 'use = "at"\nplace = 5.9'},
    )
    truth = {"beyond": work(5.9)}
    return Case(text, data, lambda _: truth, {name: own + sampler for name, own in variants.items()})


# A hyperbolic tangent that an exponential cannot follow: an example of Sargsyan, Huan and Najm, Int. J. Uncertainty
# Quantification 9 (2019) 365.


def tangent():
    places = [-0.9, -0.5, -0.1, 0.3, 0.7, 1.0, 1.1, 1.2]
    true = lambda x: np.tanh(3 * (x - 0.3))

    def data(number):
        x = np.linspace(-1, 1, 11)
        y = true(x) + 0.1 * np.random.default_rng([2014, number]).standard_normal(11)
        got = dict(zip(np.round(x, 6), y))
        grid = [round(-1 + 0.1 * j, 6) for j in range(23)]
        return table("x,y", grid, [got.get(x) for x in grid])

    noise = "variance = { known = 0.01 }"
    both = "spread = { rate = { half_normal = 1 }, factor = { half_normal = 1 } }"
    process = ["bias = { half_normal = 0.5 }", "correlation_length = { log_normal = [-0.7, 0.7] }", noise]
    variants = {
        "gaussian": discrepancy("gaussian", "variance = { half_normal = 1 }"),
        "embedded, factor": discrepancy("embedded", "spread = { factor = { half_normal = 1 } }", noise),
        "embedded, both": discrepancy("embedded", both, noise),
        "gaussian_process, not orthogonal": discrepancy("gaussian_process", "orthogonal = false", *process),
    }
    sampler = ENSEMBLE.format(walkers=14, steps=800)
    own = lambda name: 'start = "prior"\n' if name.startswith("embedded") else ""
    text = study(
        {"rate": "{ uniform = [0.0, 3.0] }", "factor": "{ uniform = [0.1, 6.0] }"},
        'x = { first = -1.0, last = 1.2, count = 23, unit = "1" }',
        "factor * exp(rate * x) - 2",
        {f"at_{i}": f'use = "at"\nplace = {x}' for i, x in enumerate(places)},
    )
    truth = {f"at_{i}": float(true(x)) for i, x in enumerate(places)}
    return Case(text, data, lambda _: truth, {name: v + sampler + own(name) for name, v in variants.items()})


# Two peaks under the warps of Tucker, Wu and Srivastava, Computational Statistics and Data Analysis 61 (2013) 50.


def warp(sets):
    times = np.linspace(-3, 3, 61)

    def drawn(number):
        rng = np.random.default_rng(100 + number)
        a = -1 + 2 * number / max(sets - 1, 1)
        return rng, a, rng.normal(1, 0.25, 2)

    def data(number):
        rng, a, (first, second) = drawn(number)
        u = (times + 3) / 6
        at = 6 * (np.expm1(a * u) / np.expm1(a) if abs(a) > 1e-12 else u) - 3
        y = first * np.exp(-0.5 * (at - 1.5) ** 2) + second * np.exp(-0.5 * (at + 1.5) ** 2)
        return table("time,y", times, y + 0.02 * rng.standard_normal(len(times)))

    def truth(number):
        _, _, (first, second) = drawn(number)
        return {"first": first, "second": second, "merged": (first + second) * np.exp(-0.125)}

    known = discrepancy("gaussian", "variance = { known = 4e-4 }")
    free = discrepancy("gaussian", "variance = { half_normal = 0.1 }")
    process = [
        "variance = { half_normal = 0.1 }",
        "bias = { half_normal = 0.5 }",
        "correlation_length = { log_normal = [0.0, 0.7] }",
    ]
    linear = (
        '[[effect]]\nuse = "delay"\ntime = { normal = [0, 0.5] }\n'
        '[[effect]]\nuse = "clock_rate"\nrate = { uniform = [-0.4, 0.6] }\n'
    )
    warped = '[[effect]]\nuse = "time_warp"\ndeviation = { half_normal = 0.3 }\n'
    sampler = ENSEMBLE.format(walkers=40, steps=2000)
    variants = {
        "gaussian, noise known": known + sampler,
        "the same, delay and clock_rate": known + sampler + linear,
        "the same, time_warp": known + NO_U_TURN + warped,
        "gaussian, noise unknown": free + sampler,
        "noise unknown, delay and clock_rate": free + sampler + linear,
        "noise unknown, time_warp": free + NO_U_TURN + warped,
        "gaussian_process": discrepancy("gaussian_process", *process) + sampler,
        "gaussian_process, not orthogonal": discrepancy("gaussian_process", "orthogonal = false", *process) + sampler,
    }
    text = study(
        {"first": "{ uniform = [0.0, 3.0] }", "second": "{ uniform = [0.0, 3.0] }"},
        'time = { first = -3.0, last = 3.0, count = 61, unit = "1" }',
        "first * exp(-0.5 * (time - 1.5)^2) + second * exp(-0.5 * (time + 1.5)^2)",
        {"merged": 'use = "expression"\nformula = "(first + second) * exp(-0.125)"'},
    )
    return Case(text, data, truth, variants)


def distance(tolerance, *options, metric="wasserstein"):
    return discrepancy(
        "approximate_bayesian_computation",
        f'metric = "{metric}"',
        f"tolerance = {{ known = {tolerance} }}",
        "simulations = 50",
        *options,
    )


# Records of one peak whose time scatters.


def peaks():
    times = np.linspace(0, 10, 41)
    root = float(np.sqrt(2 * np.pi))

    def data(number):
        rng = np.random.default_rng(500 + number)
        lines = ["replicate,time,y"]
        for record in range(6):
            lag = rng.normal(0, 0.8)
            y = 2 * np.exp(-0.5 * ((times - 5 - lag) / 0.7) ** 2) + 0.05 * rng.standard_normal(len(times))
            lines += [f"{record},{t:.10g},{v:.10g}" for t, v in zip(times, y)]
        return "\n".join(lines) + "\n"

    noise = discrepancy("gaussian", "variance = { half_normal = 10.0 }")
    jitter = '[[effect]]\nuse = "timing_jitter"\ndeviation = { half_normal = 1 }\n'
    sampler = ENSEMBLE.format(walkers=40, steps=1500)
    variants = {
        "gaussian": noise + sampler,
        "gaussian with timing_jitter": noise + sampler + jitter,
        "approximate_bayesian_computation": distance(0.05, "variance = { known = 0.0025 }") + PARTICLES,
    }
    text = study(
        {"height": "{ uniform = [0.0, 5.0] }", "width": "{ uniform = [0.2, 3.0] }"},
        'time = { first = 0.0, last = 10.0, count = 41, unit = "1" }',
        "height * exp(-0.5 * ((time - 5) / width)^2)",
        {"impulse": f'use = "expression"\nformula = "{root!r} * height * width"'},
    )
    truth = {"height": 2.0, "width": 0.7, "impulse": 1.4 * root}
    return Case(text, data, lambda _: truth, variants)


# Draws in any order of the g-and-k distribution (Rayner and MacGillivray, Statistics and Computing 12 (2002) 57).


def quantile(z, location=3.0, scale=1.0, skewness=2.0, kurtosis=0.5):
    return location + scale * (1 + 0.8 * np.tanh(skewness * z / 2)) * (1 + z * z) ** kurtosis * z


HIGH = float(norm.ppf(0.99))
QUANTILES = {"location": 3.0, "scale": 1.0, "skewness": 2.0, "kurtosis": 0.5, "high": float(quantile(HIGH))}


def with_quantiles(z):
    """The study whose response is these quantiles."""
    formula = "location + scale * (1 + 0.8 * tanh(skewness * {z} / 2)) * (1 + {z}^2)^kurtosis * {z}"
    grid = ", ".join(f"{x:.10g}" for x in z)
    return study(
        {name: "{ uniform = [0.0, 10.0] }" for name in ("location", "scale", "skewness", "kurtosis")},
        f'z = {{ values = [{grid}], unit = "1" }}',
        formula.format(z="z"),
        {"high": f'use = "expression"\nformula = "{formula.format(z=repr(HIGH))}"'},
    )


def sample():
    z = norm.ppf((np.arange(100) + 0.5) / 100)

    def data(number):
        return table("z,y", z, quantile(np.random.default_rng(500 + number).standard_normal(100)))

    sampler = ENSEMBLE.format(walkers=40, steps=1500)
    variants = {
        "gaussian": discrepancy("gaussian", "variance = { half_normal = 10.0 }") + sampler,
        "approximate_bayesian_computation": distance(0.15, "sample = true", "variance = { known = 1e-6 }") + PARTICLES,
    }
    return Case(with_quantiles(z), data, lambda _: QUANTILES, variants)


# The distances beside each other: 40 draws of that distribution, with a quarter of the median distance between two such
# samples as the tolerance.


def distances():
    z = norm.ppf((np.arange(40) + 0.5) / 40)

    def data(number):
        return table("z,y", z, quantile(np.random.default_rng(700 + number).standard_normal(40)))

    options = ["sample = true", "variance = { known = 1e-6 }"]
    tolerances = {"wasserstein": 0.13, "energy": 0.07, "maximum_mean_discrepancy": 0.034, "jensen_shannon": 0.05}
    variants = {
        metric: distance(tolerance, *options, metric=metric) + PARTICLES for metric, tolerance in tolerances.items()
    }
    return Case(with_quantiles(z), data, lambda _: QUANTILES, variants)


# One record of a peak that comes at a random time, as points of a plane; the tolerance is the median distance at the truth.


def late():
    times = np.linspace(0, 10, 31)

    def data(number):
        rng = np.random.default_rng(900 + number)
        y = 2 * np.exp(-0.5 * ((times - 5 - rng.normal(0, 0.3)) / 0.7) ** 2)
        return table("time,y", times, y + 0.05 * rng.standard_normal(31))

    options = ["axis_weight = 3.0", "variance = { known = 0.0025 }"]
    tolerances = {"wasserstein": 0.062, "energy": 0.087, "maximum_mean_discrepancy": 0.037, "jensen_shannon": 0.26}
    own = {"maximum_mean_discrepancy": ["bandwidth = 1.0"]}
    variants = {"gaussian": discrepancy("gaussian", "variance = { known = 0.0025 }") + PARTICLES}
    variants |= {
        metric: distance(tolerance, *options, *own.get(metric, []), metric=metric) + PARTICLES
        for metric, tolerance in tolerances.items()
    }
    text = study(
        {"height": "{ uniform = [0.0, 5.0] }", "width": "{ uniform = [0.2, 3.0] }"},
        'time = { first = 0.0, last = 10.0, count = 31, unit = "1" }',
        "height * exp(-0.5 * ((time - 5) / width)^2)",
        {},
    )
    truth = {"height": 2.0, "width": 0.7}
    return Case(text, data, lambda _: truth, variants)


def exact_posterior(data, seed, steps=20000, kept=6000):
    """Draws of location, scale, skewness and kurtosis: the density by inversion of the quantiles, adaptive Metropolis."""
    z = np.linspace(-6, 6, 3001)

    def log_density(theta):
        if np.any(theta <= 0) or np.any(theta >= 10):
            return -np.inf
        q = quantile(z, *theta)
        slope = np.gradient(q, z)
        if slope.min() <= 0:
            return -np.inf
        at = np.interp(data, q, z)
        return np.sum(norm.logpdf(at) - np.log(np.interp(at, z, slope)))

    rng = np.random.default_rng(seed)
    theta = np.array([3.0, 1.0, 2.0, 0.5])
    log, covariance, drawn = log_density(theta), np.diag([0.05, 0.1, 0.3, 0.05]) ** 2, []
    for step in range(steps):
        if step in (2000, 5000):
            covariance = np.cov(np.array(drawn[step // 2 :]).T) * 2.38**2 / 4 + 1e-8 * np.eye(4)
        proposed = rng.multivariate_normal(theta, covariance)
        log_proposed = log_density(proposed)
        if np.log(rng.random()) < log_proposed - log:
            theta, log = proposed, log_proposed
        drawn.append(theta)
    return np.array(drawn[kept:])


def show_exact(case, sets):
    """The row of the exact likelihood of the g-and-k distribution, computed here."""
    truth = np.array(list(case.truth(0).values()))
    found = []
    for number in range(sets):
        rows = case.data(number).split()[1:]
        draws = exact_posterior(np.array([float(row.split(",")[1]) for row in rows]), number)
        draws = np.column_stack([draws, quantile(norm.ppf(0.99), *draws.T)])
        low, high = np.quantile(draws, [0.025, 0.975], axis=0)
        found.append(np.stack([(low <= truth) & (truth <= high), high - low, draws.mean(axis=0)]))
    inside, widths, means = np.stack(found).swapaxes(0, 1)
    cells = [
        f"{int(inside[:, k].sum())} of {sets}, {widths[:, k].mean():.3g}, {means[:, k].mean():.4g}"
        for k in range(len(truth))
    ]
    print("| exact likelihood, without the program | " + " | ".join(cells) + " | |\n")


def run(program, folder, text, data, number):
    """The summary of a run, or what the program said."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "data.csv").write_text(data)
    (folder / "study.toml").write_text(text.replace("[study]\n", f"[study]\nseed = {number}\n", 1))
    summary = folder / "run" / "summary.json"
    if not summary.exists():
        command = [program, "run", "study.toml", "--out", "run", "--threads", "1"]
        ran = subprocess.run(command, cwd=folder, capture_output=True, text=True)
        if not summary.exists():
            return None, ran.stdout[-1000:] + ran.stderr[-1000:]
    return json.loads(summary.read_text()), ""


def judged(summary, truth):
    """For each number: true if the interval contains the truth, the width of the interval, and the mean."""
    numbers = {**summary["parameters"], **summary.get("quantities", {})}
    found = ((numbers[name], value) for name, value in truth.items())
    return [(q["q025"] <= value <= q["q975"], q["q975"] - q["q025"], q["mean"]) for q, value in found]


def adapted(text, variant):
    """The study of a variant: some of them cut the first parameter."""
    if not variant.startswith("cut"):
        return text
    first = text.index("prior = ")
    return text[:first] + "cut = true\n" + text[first:]


def show(program, case, sets, only, folder):
    variants = {name: own for name, own in case.variants.items() if not only or name in only}
    jobs = [(name, number) for name in variants for number in range(sets)]

    def one(job):
        name, number = job
        place = folder / name.replace(",", "").replace(" ", "-") / str(number)
        text = case.study if isinstance(case.study, str) else case.study(number)
        return run(program, place, adapted(text, name) + "\n" + variants[name], case.data(number), number)

    with ThreadPoolExecutor() as pool:
        results = dict(zip(jobs, pool.map(one, jobs)))
    columns = list(case.truth(0))
    print("| | " + " | ".join([*columns, "log evidence"]) + " |\n|" + "---|" * (len(columns) + 2))
    for name in variants:
        own = [(results[name, number], case.truth(number)) for number in range(sets)]
        known = [judged(summary, truth) for (summary, _), truth in own if summary]
        for (summary, said), _ in own:
            if not summary:
                print(f"<!-- {name}: {said.strip()} -->")
        if not known:
            continue
        cells = []
        for k in range(len(columns)):
            inside, widths, means = zip(*(found[k] for found in known))
            cells.append(f"{sum(inside)} of {len(known)}, {np.mean(widths):.3g}, {np.mean(means):.4g}")
        evidence = [(summary.get("evidence") or {}).get("log") for (summary, _), _ in own if summary]
        evidence = [log for log in evidence if log is not None]
        cells.append(f"{np.mean(evidence):.1f}" if evidence else "")
        print(f"| {name} | " + " | ".join(cells) + " |", flush=True)
    print()


def main():
    cases = ["machine", "modular", "tangent", "warp", "adjustments", "peaks", "sample", "distances", "late"]
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("lacuna")
    parser.add_argument("--case", nargs="+", choices=cases, default=cases)
    parser.add_argument("--only", nargs="+")
    parser.add_argument("--sets", type=int, default=20)
    parser.add_argument("--out", type=Path)
    asked = parser.parse_args()
    made = {
        "machine": machine,
        "modular": modular,
        "tangent": tangent,
        "warp": lambda: warp(asked.sets),
        "adjustments": adjustments,
        "peaks": peaks,
        "sample": sample,
        "distances": distances,
        "late": late,
    }
    with tempfile.TemporaryDirectory() as temporary:
        folder = (asked.out or Path(temporary)).resolve()
        for name in asked.case:
            print(f"{name}: 95 % intervals that contain the truth, mean width, mean estimate\n")
            program = str(Path(asked.lacuna).resolve())
            case = made[name]()
            show(program, case, asked.sets, asked.only, folder / name)
            if name == "sample" and not asked.only:
                show_exact(case, asked.sets)


if __name__ == "__main__":
    main()
