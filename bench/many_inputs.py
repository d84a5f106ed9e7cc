"""Surrogates of many inputs that Lacuna does not have, or has in another form, on the runs of the table in docs/many_inputs.md.

    mkdir runs
    LACUNA_RUNS=$PWD/runs cargo test -p lacuna-plugins --lib -- --ignored runs_of_many_inputs
    python bench/many_inputs.py gradients runs
    python bench/many_inputs.py differences runs
    python bench/many_inputs.py networks runs

Needs `pip install numpy scipy scikit-learn`. The test writes the runs, two Latin hypercubes of each size, and 2000 new points.
Each line has the mean square error at the new points divided by the variance, for both designs.

`gradients`: sparse expansions by orthogonal matching pursuit, from values alone and from half as many runs with their gradients
(as many runs in all, if a gradient costs one run), and expansions in active subspaces found from these gradients.
`differences`: the same with gradients by differences, each of which costs as many runs as there are inputs.
`networks`: ensembles of five multilayer perceptrons, whose size and penalty are chosen by cross-validation; in parentheses the
error as the ensemble states it: the variance between its members, and the error of the cross-validation.
"""

import argparse
import itertools
import pathlib
import time
import warnings

import numpy as np
from scipy import sparse
from scipy.linalg import solve_triangular

FUNCTIONS = {
    "borehole-u": (20, 100, 300),
    "Welch-u": (100, 200, 500),
    "Morris-u": (200, 500),
    "diffusion50inputs-n": (100, 200, 500),
    "diffusion100inputs-n": (100, 200, 500),
    "UQLab100inputs-u": (100, 200, 300, 500),
}


def read(path):
    """Points, values and gradients of a table."""
    table = np.loadtxt(path, delimiter=",", ndmin=2)
    inputs = (table.shape[1] - 1) // 2
    return table[:, 1 : 1 + inputs], table[:, 0], table[:, 1 + inputs :]


def univariate(x, law, degree):
    """Orthonormal polynomials at points: values and slopes, `degree + 1` x points."""
    value, slope = np.zeros((2, degree + 1, *x.shape))
    value[0] = 1.0
    value[1] = x
    slope[1] = 1.0
    for n in range(1, degree):
        if law == "u":
            value[n + 1] = ((2 * n + 1) * x * value[n] - n * value[n - 1]) / (n + 1)
            slope[n + 1] = slope[n - 1] + (2 * n + 1) * value[n]
        else:
            value[n + 1] = x * value[n] - n * value[n - 1]
            slope[n + 1] = (n + 1) * value[n]
    orders = np.arange(degree + 1)
    factorials = np.cumprod(np.concatenate([[1.0], orders[1:]]))
    norm = np.sqrt(2 * orders + 1) if law == "u" else 1 / np.sqrt(factorials)
    return value * norm[:, None, None], slope * norm[:, None, None]


def dictionary(inputs, degree, q, interaction, most=6000):
    """Terms as lists of (input, order), by the norm `(sum order^q)^(1/q)`."""
    terms = []
    for size in range(1, interaction + 1):
        orders = [o for o in itertools.product(range(1, degree + 1), repeat=size)
                  if sum(k**q for k in o) ** (1 / q) <= degree + 1e-9]
        for places in itertools.combinations(range(inputs), size):
            terms += [tuple(zip(places, o)) for o in orders]
        if len(terms) > 8 * most:
            break
    terms.sort(key=lambda term: sum(order**q for _, order in term) ** (1 / q))
    return [()] + terms[: most - 1]


def design(x, law, terms, gradients):
    """Values of the terms, and of their slopes times the weight under which they are orthogonal; row blocks by input."""
    degree = max((order for term in terms for _, order in term), default=1)
    value, slope = univariate(x, law, max(degree, 1))
    runs, inputs = x.shape
    root = np.sqrt(np.clip(1 - x**2, 0, None)) if law == "u" else np.ones_like(x)
    columns, rows, cells = [], [], []
    for k, term in enumerate(terms):
        cell = np.ones(runs)
        for j, order in term:
            cell = cell * value[order][:, j]
        rows.append(np.arange(runs))
        columns.append(np.full(runs, k))
        cells.append(cell)
        if not gradients:
            continue
        for j, order in term:
            cell = slope[order][:, j] * root[:, j]
            for i, other in term:
                if i != j:
                    cell = cell * value[other][:, i]
            rows.append(runs * (j + 1) + np.arange(runs))
            columns.append(np.full(runs, k))
            cells.append(cell)
    height = runs * (inputs + 1) if gradients else runs
    parts = [np.concatenate(part) for part in (cells, rows, columns)]
    return sparse.csc_matrix((parts[0], (parts[1], parts[2])), (height, len(terms)))


def weighted(x, law, y, slopes):
    root = np.sqrt(np.clip(1 - x**2, 0, None)) if law == "u" else np.ones_like(x)
    return np.concatenate([y, (slopes * root).T.ravel()])


def pursuit(gram, moments, norms, most):
    """Orthogonal matching pursuit from inner products: the terms in their order, and the coefficients at each size."""
    chosen, coefficients = [], []
    factor, taken = np.zeros((most, most)), np.zeros((len(moments), most), order="F")
    residual = moments.copy()
    free = norms > 1e-12
    for k in range(most):
        score = np.where(free, np.abs(residual) / np.maximum(norms, 1e-300), -1)
        best = int(np.argmax(score))
        if score[best] <= 0:
            break
        row = gram[best, chosen] if chosen else np.zeros(0)
        w = solve_triangular(factor[:k, :k], row, lower=True) if k else row
        rest = gram[best, best] - w @ w
        free[best] = False
        if rest <= 1e-10 * gram[best, best]:
            coefficients.append(coefficients[-1] if coefficients else np.zeros(0))
            continue
        k = len(chosen)
        factor[k, :k], factor[k, k] = w, np.sqrt(rest)
        chosen.append(best)
        taken[:, k] = gram[:, best]
        half = solve_triangular(factor[: k + 1, : k + 1], moments[chosen], lower=True)
        c = solve_triangular(factor[: k + 1, : k + 1].T, half, lower=False)
        residual = moments - taken[:, : k + 1] @ c
        coefficients.append(c)
    return chosen, coefficients


def expansion(x, law, y, slopes, terms, folds=5):
    """Coefficients of a sparse expansion whose size is chosen by cross-validation over runs, and its error."""
    gradients = slopes is not None
    runs = len(y)
    mean, scale = y.mean(), y.std()
    z = (y - mean) / scale
    a = design(x, law, terms, gradients)
    b = weighted(x, law, z, slopes / scale) if gradients else z
    block = np.arange(a.shape[0]) % runs
    fold_of = np.random.default_rng(0).permutation(runs) % folds
    gram_all, moments_all = (a.T @ a).toarray(), a.T @ b
    most = min(len(terms), a.shape[0] // 3 if gradients else (2 * runs) // 3, 700)
    errors = np.zeros(most)
    for fold in range(folds):
        out = np.isin(block, np.flatnonzero(fold_of == fold))
        left = a[out]
        gram = gram_all - (left.T @ left).toarray()
        moments = moments_all - left.T @ b[out]
        chosen, found = pursuit(gram, moments, np.sqrt(np.diag(gram)), most)
        test = np.flatnonzero(fold_of == fold)
        values = a[test].toarray()
        for size in range(most):
            c = found[min(size, len(found) - 1)]
            errors[size] += np.sum((z[test] - values[:, chosen[: len(c)]] @ c) ** 2)
    size = int(np.argmin(errors)) + 1
    chosen, found = pursuit(gram_all, moments_all, np.sqrt(np.diag(gram_all)), size)
    c = found[-1]
    kept = [terms[k] for k in chosen[: len(c)]]
    return (lambda new: mean + scale * (design(new, law, kept, False) @ c)), errors[size - 1] / runs


def best_expansion(x, law, y, slopes, inputs):
    """The expansion of the degree and norm with the smallest error of the cross-validation."""
    if inputs <= 15:
        sets = [(p, q, 3) for p in (2, 3, 4, 5) for q in (0.75, 1.0)]
    else:
        sets = [(p, q, 2) for p, q in ((1, 1.0), (2, 1.0), (3, 0.75), (4, 0.5), (6, 0.5), (10, 0.5)) if p < 10 or inputs <= 20]
    found = [expansion(x, law, y, slopes, dictionary(inputs, *s, most=6000 if inputs > 15 else 1200)) for s in sets]
    return min(found, key=lambda pair: pair[1])


def monomials(inputs, degree):
    return [o for o in itertools.product(range(degree + 1), repeat=inputs) if sum(o) <= degree]


def in_subspace(x, y, slopes):
    """Least squares in the leading directions of the mean of the gradients' squares (Constantine, Dow and Wang 2014), with values and
    gradients; dimension and degree have the smallest leave-one-out error of the values."""
    runs = len(y)
    mean, scale = y.mean(), y.std()
    z, g = (y - mean) / scale, slopes / scale
    values, vectors = np.linalg.eigh(g.T @ g / runs)
    order = np.argsort(values)[::-1]
    best = (np.inf, None)
    for dimension in range(1, min(9, x.shape[1]) + 1):
        w = vectors[:, order[:dimension]]
        u = x @ w
        spread = u.std(axis=0)
        u, h = u / spread, g @ w * spread
        for degree in range(1, 8):
            powers = np.array(monomials(dimension, degree))
            if len(powers) > (runs * (1 + dimension)) // 3 or len(powers) > 800:
                break
            value, slope = univariate(u, "n", degree)
            ones = lambda i, o: value[o[i]][:, i]
            a = np.stack([np.prod([ones(i, o) for i in range(dimension)], axis=0) for o in powers], axis=1)
            parts = [a]
            for j in range(dimension):
                parts.append(np.stack([slope[o[j]][:, j] * np.prod([ones(i, o) for i in range(dimension) if i != j], axis=0)
                                       for o in powers], axis=1))
            b = np.concatenate([z, h.T.ravel()])
            folds, error = np.random.default_rng(0).permutation(runs) % 5, 0.0
            whole = np.concatenate(parts)
            block = np.arange(len(whole)) % runs
            for fold in range(5):
                out = np.isin(block, np.flatnonzero(folds == fold))
                c = np.linalg.lstsq(whole[~out], b[~out], rcond=1e-10)[0]
                error += np.sum((z[folds == fold] - a[folds == fold] @ c) ** 2)
            if error < best[0]:
                c = np.linalg.lstsq(whole, b, rcond=1e-10)[0]
                best = (error, (w, spread, powers, degree, c))
    w, spread, powers, degree, c = best[1]

    def predict(new):
        value, _ = univariate(new @ w / spread, "n", degree)
        a = [np.prod([value[o[i]][:, i] for i in range(len(o))], axis=0) for o in powers]
        return mean + scale * (np.stack(a, axis=1) @ c)

    return predict, w.shape[1]


def network(x, y):
    """An ensemble of five networks, the variance between them and the error of the cross-validation."""
    from sklearn.model_selection import KFold
    from sklearn.neural_network import MLPRegressor

    mean, scale = y.mean(), y.std()
    z = (y - mean) / scale
    spread = x.std(axis=0)
    u = x / spread

    def fitted(rows, hidden, activation, penalty, seed):
        net = MLPRegressor(hidden_layer_sizes=hidden, activation=activation, alpha=penalty, solver="lbfgs", max_iter=1000, random_state=seed)
        return net.fit(u[rows], z[rows])

    best = (np.inf, None)
    for choice in itertools.product(((20,), (64,), (64, 64)), ("tanh", "relu"), (1e-3, 1e-1, 3.0)):
        error = 0.0
        for train, test in KFold(4, shuffle=True, random_state=0).split(u):
            error += np.sum((fitted(train, *choice, 0).predict(u[test]) - z[test]) ** 2)
        best = min(best, (error / len(z), choice), key=lambda pair: pair[0])
    members = [fitted(np.arange(len(z)), *best[1], seed) for seed in range(5)]

    def predict(new):
        found = np.stack([member.predict(new / spread) for member in members])
        return mean + scale * found.mean(axis=0), scale**2 * found.var(axis=0, ddof=1)

    return predict, best


def error(found, truth):
    return np.mean((found - truth) ** 2) / truth.var()


def gradients(folder, name, runs):
    law = name[-1]
    new, truth, _ = read(folder / f"{name}-new.csv")
    lines = {"values": [], "half with gradients": [], "active subspace": [], "directions": []}
    for seed in (1, 2):
        x, y, _ = read(folder / f"{name}-{runs}-{seed}.csv")
        lines["values"].append(f"{error(best_expansion(x, law, y, None, x.shape[1])[0](new), truth):.2g}")
        x, y, g = read(folder / f"{name}-{runs}-{seed}-half.csv")
        lines["half with gradients"].append(f"{error(best_expansion(x, law, y, g, x.shape[1])[0](new), truth):.2g}")
        predict, dimension = in_subspace(x, y, g)
        lines["active subspace"].append(f"{error(predict(new), truth):.2g}")
        lines["directions"].append(str(dimension))
    return lines


def differences(folder, name, runs):
    """Expansions with gradients by differences: one run for each input beside each point."""
    law = name[-1]
    new, truth, _ = read(folder / f"{name}-new.csv")
    lines = {"points": [], "with differences": []}
    for seed in (1, 2):
        x, y, g = (part[: runs // (1 + new.shape[1])] for part in read(folder / f"{name}-{runs}-{seed}-half.csv"))
        lines["points"].append(str(len(y)))
        if len(y) >= 5:
            lines["with differences"].append(f"{error(best_expansion(x, law, y, g, x.shape[1])[0](new), truth):.2g}")
    return lines


def networks(folder, name, runs):
    new, truth, _ = read(folder / f"{name}-new.csv")
    lines = {"network": [], "between members": [], "cross-validation": [], "choice": []}
    for seed in (1, 2):
        x, y, _ = read(folder / f"{name}-{runs}-{seed}.csv")
        predict, (validated, choice) = network(x, y)
        found, variance = predict(new)
        lines["network"].append(f"{error(found, truth):.2g}")
        lines["between members"].append(f"{variance.mean() / truth.var():.2g}")
        lines["cross-validation"].append(f"{validated:.2g}")
        lines["choice"].append(" ".join(map(str, choice)))
    return lines


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=["gradients", "differences", "networks"])
    parser.add_argument("runs", type=pathlib.Path)
    parser.add_argument("--function", default="", help="only functions whose name begins so")
    parser.add_argument("--sizes", type=int, nargs="*", help="only these numbers of runs")
    arguments = parser.parse_args()
    measure = {"gradients": gradients, "differences": differences, "networks": networks}[arguments.what]
    warnings.simplefilter("ignore")
    for name, sizes in FUNCTIONS.items():
        if not name.startswith(arguments.function):
            continue
        for runs in (size for size in sizes if not arguments.sizes or size in arguments.sizes):
            start = time.process_time()
            lines = measure(arguments.runs, name, runs)
            cells = "; ".join(f"{what}: {', '.join(found)}" for what, found in lines.items())
            print(f"{name}, {runs} runs: {cells} ({time.process_time() - start:.0f} s)", flush=True)


if __name__ == "__main__":
    main()
