"""Coverage of intervals for several covariances of an emulator's error, computed independently of the engine.

    python bench/emulator_error.py [MODEL:SURROGATE:RUNS ...]

Needs numpy, scipy and scikit-learn. Models of three parameters on the unit cube, five Latin hypercubes each, 40 truths per design,
half of them in an outer tenth of one parameter; the noise of the mean curve is known. Prints the coverage of central intervals of
50, 90 and 95 %, the last at the edges too, and the median ratio of the posterior standard deviation to that of a calibration with
the model itself. Covariances, by name:

loo       mean square of the curves
damped    loo with damped correlations
factor    damped, enlarged until left-out runs shift their parameters by the amount the posterior predicts
data      like factor, with its size at the parameters indicated by the data (Gaussian processes, or 50 curves)
near      like data, with the factor from runs as far from the edges as the parameters indicated by the data
varying   like factor, with its size a function of the parameters in the likelihood, including its determinant
unknown   like factor, with its size integrated out under a log-normal law with the scatter of the curves
"""

import itertools
import sys
import warnings

import numpy as np
from scipy.stats import qmc
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import ConstantKernel, Matern, WhiteKernel
from sklearn.linear_model import lars_path

warnings.filterwarnings("ignore")
DESIGNS, TRUTHS = 5, 40
CASES = ["pce3:24", "gp:24", "pce8:150", "gp:150"]
FACTORS = np.array([1, 1.25, 1.5, 2, 2.5, 3, 4, 6, 8])


def oscillator(u):
    t = np.linspace(0.05, 2, 40)
    f, d, a = 1.5 + u[:, :1], 0.5 + 2.5 * u[:, 1:2], 0.6 + 0.8 * u[:, 2:]
    return a * np.exp(-d * t) * np.cos(2 * np.pi * f * t)


def reactions(u):
    t = np.linspace(0.1, 4, 25)
    k, l, a = np.exp(3 * u[:, :1] - 1), np.exp(2.5 * u[:, 1:2] - 1), 0.7 + 0.6 * u[:, 2:]
    d = np.where(abs(k - l) < 1e-6, 1e-6, k - l)
    second = a * k / d * (np.exp(-l * t) - np.exp(-k * t))
    third = a * (1 - (k * np.exp(-l * t) - l * np.exp(-k * t)) / d)
    return np.hstack([second, third])


def pulse(u):
    x = np.linspace(0, 1, 30)
    c, w, q = 0.6 + 0.5 * u[:, :1], 0.08 + 0.12 * u[:, 1:2], 0.5 + u[:, 2:]
    parts = [q / np.sqrt(1 + 4 * t * w) * np.exp(-((x - c * t) ** 2) / (2 * (w**2 + 0.02 * t))) for t in (0.3, 0.7)]
    return np.hstack(parts)


# Model, standard deviation of the noise, replicates, number of groups of outputs.
MODELS = {"oscillator": (oscillator, 0.02, 5, 1), "reactions": (reactions, 0.01, 3, 2), "pulse": (pulse, 0.01, 3, 2)}


class Expansion:
    """Legendre polynomials up to a total degree by least-angle regression, each output separately."""

    def __init__(self, x, y, degree):
        self.degree, n = degree, len(x)
        basis = self.basis(x)
        self.coefficients = np.zeros((basis.shape[1], y.shape[1]))
        for j in range(y.shape[1]):
            _, order, _ = lars_path(basis[:, 1:], y[:, j] - y[:, j].mean(), max_iter=min(n - 4, basis.shape[1] - 1))
            terms, best = list(dict.fromkeys(order)), (np.inf, None, None)
            for m in range(len(terms) + 1):
                active = [0] + [1 + t for t in terms[:m]]
                a = basis[:, active]
                gram = a.T @ a
                if m + 1 >= n - 2 or np.linalg.cond(gram) > 1e10:
                    break
                inverse = np.linalg.inv(gram)
                c = inverse @ (a.T @ y[:, j])
                left = (y[:, j] - a @ c) / np.maximum(1 - np.einsum("ij,jk,ik->i", a, inverse, a), 1e-9)
                loo = np.mean(left**2) * n / (n - m - 1) * (1 + np.trace(inverse))
                if loo < best[0]:
                    best = (loo, active, c)
            self.coefficients[best[1], j] = best[2]

    def basis(self, u):
        x, one = 2 * u - 1, [np.ones_like(u), 2 * u - 1]
        for n in range(1, self.degree):
            one.append(((2 * n + 1) * x * one[-1] - n * one[-2]) / (n + 1))
        one = [p * np.sqrt(2 * n + 1) for n, p in enumerate(one)]
        degrees = [d for d in itertools.product(range(self.degree + 1), repeat=3) if sum(d) <= self.degree]
        return np.stack([one[a][:, 0] * one[b][:, 1] * one[c][:, 2] for a, b, c in degrees], 1)

    def __call__(self, u):
        return self.basis(u) @ self.coefficients

    def variance(self, u):
        return None


class Process:
    """Principal components, with one Gaussian process each."""

    def __init__(self, x, y):
        self.mean = y.mean(0)
        left, values, right = np.linalg.svd(y - self.mean, full_matrices=False)
        rank = min(np.searchsorted(np.cumsum(values**2) / np.sum(values**2), 0.99999) + 1, len(values) - 1)
        scores, self.directions = left[:, :rank] * values[:rank], right[:rank]
        self.scale, self.rest = scores.std(0), ((y - self.mean - scores @ self.directions) ** 2).mean(0)
        kernel = ConstantKernel(1, (1e-2, 1e3)) * Matern([0.7] * 3, (0.05, 20), nu=2.5) + WhiteKernel(1e-6, (1e-10, 1))
        self.parts = [GaussianProcessRegressor(kernel).fit(x, s) for s in (scores / self.scale).T]

    def __call__(self, u):
        scores = [p.kernel_.k1(u, p.X_train_) @ p.alpha_ for p in self.parts]
        return self.mean + (np.array(scores).T * self.scale) @ self.directions

    def variance(self, u):
        def one(p):
            solved = np.linalg.solve(p.L_, p.kernel_.k1(u, p.X_train_).T)
            return p.kernel_.k1.diag(u) + p.kernel_.k2.noise_level - (solved**2).sum(0)

        return (np.array([one(p) for p in self.parts]).T * self.scale**2) @ self.directions**2 + self.rest


def fitted(kind, x, y):
    return Expansion(x, y, int(kind[3:])) if kind.startswith("pce") else Process(x, y)


def left_out(kind, x, y):
    """Errors and stated variances of ten-fold cross-validation at the left-out runs."""
    errors, stated, part = np.zeros_like(y), np.zeros_like(y), np.arange(len(x)) % 10
    for k in range(10):
        own = part == k
        emulator = fitted(kind, x[~own], y[~own])
        errors[own], variance = y[own] - emulator(x[own]), emulator.variance(x[own])
        stated = None if variance is None else stated
        if variance is not None:
            stated[own] = variance
    return errors, stated


def damping(outputs, groups):
    n = outputs // groups
    place, group = np.tile(np.arange(n) / n, groups), np.repeat(np.arange(groups), n)
    near = np.exp(-0.5 * ((place[:, None] - place) / 0.15) ** 2)
    return near * np.where(group[:, None] == group, 1, 0.7)


def slopes(emulator, u, h=1e-4):
    return np.stack([(emulator(u + h * e) - emulator(u - h * e)) / (2 * h) for e in np.eye(3)], 2)


def matern(d):
    r = np.sqrt(5) * d
    return (1 + r + r * r / 3) * np.exp(-r)


class Distance:
    """Variance of a process of unit prior variance conditioned on the runs, with an unknown mean."""

    def __init__(self, x, length):
        self.x, self.length = x, length
        self.inverse = np.linalg.inv(matern(self.between(x)) + 1e-4 * np.eye(len(x)))

    def between(self, u):
        return np.linalg.norm(u[:, None] - self.x[None], axis=2) / self.length

    def __call__(self, u):
        k = matern(self.between(u))
        one = self.inverse.sum(1)
        return np.maximum(1.0001 - ((k @ self.inverse) * k).sum(1) + (1 - k @ one) ** 2 / one.sum(), 1e-4)

    def at_runs(self):
        one = self.inverse.sum(1)
        return 1 / np.maximum(np.diag(self.inverse - np.outer(one, one) / one.sum()), 1e-9)


class Size:
    """log s = m + b (log v - mean log v)."""

    def __init__(self, x, errors, stated, emulator):
        q = np.ones(len(x))
        for _ in range(5):
            d = ((errors / q[:, None]) ** 2).mean(0)
            q = np.sqrt((errors**2 / (d + 1e-3 * d.mean())).mean(1))
        q /= np.exp(np.log(q).mean())
        logs, laws = np.log(q), [(lambda u: np.ones(len(u)), np.ones(len(x)))]
        if stated is not None:
            scale = stated.mean(0) * 1.001
            laws.append((lambda u: (emulator.variance(u) / scale).mean(1), (stated / scale).mean(1)))
        if len(x) >= 50:
            laws += [(d, d.at_runs()) for d in (Distance(x, length) for length in (0.3, 0.6, 1.2))]
        best = np.inf
        for k, (law, v) in enumerate(laws):
            z = np.log(v) - np.log(v).mean()
            b = np.clip(((z * logs).sum() / 0.3 + 0.5 / 0.09) / ((z * z).sum() / 0.3 + 1 / 0.09), 0, 1.5) if k else 0
            rest = ((logs - b * z) ** 2).mean()
            value = len(x) * np.log(rest + 0.02) + ((b - 0.5) ** 2 / 0.09 + 1 if k else 0)
            if value < best:
                best, self.law, self.slope, self.centre = value, law, b, np.log(v).mean()
                self.at_runs, self.scatter = np.exp(b * z), max(np.sqrt(rest), 0.15)

    def __call__(self, u):
        return np.exp(self.slope * (np.log(self.law(u)) - self.centre))


def shifts(shapes, sizes, jacobians, errors, noise, damp):
    """Expected squared shifts caused by left-out runs, by factor and run."""
    n, m = errors.shape
    part = np.arange(n) % (n if n <= 30 else 10)
    squares = np.zeros((len(FACTORS), n))
    for k in range(part.max() + 1):
        own = part == k
        shape = shapes[~own].T @ shapes[~own] / (~own).sum() * damp
        for i, (f, scale) in itertools.product(np.where(own)[0], enumerate(FACTORS)):
            solved = np.linalg.solve(noise * np.eye(m) + (scale * sizes[i]) ** 2 * shape, jacobians[i])
            precision = jacobians[i].T @ solved + 12 * np.eye(3)
            gain = np.linalg.solve(precision, solved.T)
            shift = gain @ errors[i]
            squares[f, i] = (shift @ precision @ shift + np.trace(precision @ gain @ gain.T) * noise) / 3
    return squares


def crossing(means):
    return 1.0 if means[0] <= 1 else np.interp(-1, -np.minimum.accumulate(means), FACTORS)


def largest(squares, x):
    """Factor required by all runs, or by the half of them nearest to the edges."""
    off, n = abs(x - 0.5).max(1), len(x)
    found = max(crossing(squares.mean(1)), crossing(squares[:, off >= np.median(off)].mean(1)))
    return found * np.sqrt((n - 1) / (n - 5))


def local(squares, x, there):
    """Factor required by runs as far from the edges as the given points; see the documentation on statistics."""
    off, n = abs(x - 0.5).max(1), len(x)
    nearest = np.argsort(abs(off - abs(there - 0.5).max(1)[:, None]), axis=1, kind="stable")[:, : max(n // 4, min(n, 12))]
    return crossing(squares[:, nearest.ravel()].mean(1)) * np.sqrt((n - 1) / (n - 5))


class Law:
    """Data around a response: independent noise and an error with the given covariance times the square of a size."""

    def __init__(self, covariance, noise, size=None, scatter=0.0):
        values, self.directions = np.linalg.eigh(covariance)
        self.values, self.noise, self.scatter = np.maximum(values, 0), noise, scatter
        self.size = size or (lambda u: np.ones(len(u)))

    def log_likelihood(self, means, sizes, y):
        a = ((y - means) @ self.directions) ** 2

        def at(s):
            v = self.noise + s[..., None] ** 2 * self.values
            return -0.5 * (np.log(v) + a / v).sum(-1)

        if not self.scatter:
            return at(sizes)
        nodes, weights = np.polynomial.hermite_e.hermegauss(7)
        each = [np.log(w / weights.sum()) + at(sizes * np.exp(self.scatter * z)) for z, w in zip(nodes, weights)]
        return np.logaddexp.reduce(each, axis=0)


def draws(emulator, law, data, rng, walkers=48, steps=240):
    """Ensembles with stretch and difference moves in the unit cube, one per data set, run together."""
    count, half = len(data), walkers // 2
    pool = rng.random((3000, 3))
    means, sizes = emulator(pool), law.size(pool)
    position = np.zeros((count, walkers, 3))
    for t in range(count):
        value = law.log_likelihood(means, sizes, data[t])
        order = np.argsort(-value)[: 2 * walkers]
        weight = np.exp(0.3 * (value[order] - value[order[0]]))
        begin = pool[rng.choice(order, walkers, p=weight / weight.sum())]
        position[t] = np.clip(begin + 0.01 * rng.standard_normal((walkers, 3)), 1e-4, 1 - 1e-4)

    def density(points):
        flat, which = points.reshape(-1, 3), np.repeat(np.arange(count), points.shape[1])
        return law.log_likelihood(emulator(flat), law.size(flat), data[which]).reshape(count, -1)

    level, kept, row = density(position), [], np.arange(count)[:, None]
    for step in range(steps):
        for a, b in ((slice(0, half), slice(half, None)), (slice(half, None), slice(0, half))):
            own, others, z = position[:, a], position[:, b], np.ones((count, half))
            if step % 3 == 0:
                i, j = rng.integers(0, half, (2, count, half))
                moved = own + 0.7 * (others[row, i] - others[row, j]) + 1e-5 * rng.standard_normal(own.shape)
            else:
                partner = others[row, rng.integers(0, half, (count, half))]
                z = (rng.random((count, half)) + 1) ** 2 / 2
                moved = partner + z[..., None] * (own - partner)
            inside = ((moved > 0) & (moved < 1)).all(-1)
            value = density(np.where(inside[..., None], moved, own))
            taken = inside & (np.log(rng.random(z.shape)) < 2 * np.log(z) + value - level[:, a])
            position[:, a] = np.where(taken[..., None], moved, own)
            level[:, a] = np.where(taken, value, level[:, a])
        if step >= steps // 3 and step % 2 == 0:
            kept.append(position.copy())
    return np.concatenate(kept, 1)


def where(best, jacobian, covariance, noise, rng):
    """Draws from the normal distribution of the least-squares estimate, inside the cube."""
    gain = np.linalg.solve(jacobian.T @ jacobian / noise + 12 * np.eye(3), jacobian.T / noise)
    root = np.linalg.cholesky(gain @ (covariance + noise * np.eye(len(covariance))) @ gain.T + 1e-12 * np.eye(3))
    points = best + rng.standard_normal((1280, 3)) @ root.T
    return np.vstack([best, points[((points > 0) & (points < 1)).all(1)][:63]])


def count(model, kind, runs):
    response, sd, replicates, groups = MODELS[model]
    noise, ranks, widths = sd**2 / replicates, {}, {}
    for seed in range(DESIGNS):
        x = qmc.LatinHypercube(3, seed=1000 + seed).random(runs)
        y, rng = response(x), np.random.default_rng([7, seed])
        emulator, (errors, stated) = fitted(kind, x, y), left_out(kind, x, y)
        truths = rng.random((TRUTHS, 3))
        for t in range(0, TRUTHS, 2):
            truths[t, rng.integers(3)] = rng.choice([0, 0.9]) + 0.1 * rng.random()
        data = response(truths) + np.sqrt(noise) * rng.standard_normal((TRUTHS, y.shape[1]))
        exact = draws(response, Law(np.zeros((y.shape[1],) * 2), noise), data, rng).std(1)
        damp, jacobians = damping(y.shape[1], groups), slopes(emulator, x)
        plain = errors.T @ errors / runs
        size = Size(x, errors, stated, emulator)
        shapes = errors / size.at_runs[:, None]
        even = largest(shifts(errors, np.ones(runs), jacobians, errors, noise, damp), x) ** 2
        squares = shifts(shapes, size.at_runs, jacobians, errors, noise, damp)
        sized = largest(squares, x) ** 2
        shape = shapes.T @ shapes / runs * damp
        laws = {
            "loo": Law(plain, noise),
            "damped": Law(plain * damp, noise),
            "factor": Law(even * plain * damp, noise),
            "varying": Law(sized * shape, noise, size),
            "unknown": Law(sized * shape, noise, size, size.scatter),
        }
        found = {name: draws(emulator, law, data, rng) for name, law in laws.items()}
        pool = rng.random((3000, 3))
        means = emulator(pool)

        def own(curve, is_local):
            best = pool[np.argmin(((curve - means) ** 2).sum(1))]
            there = where(best, slopes(emulator, best[None])[0], plain * damp, noise, rng)
            scale = local(squares, x, there) ** 2 if is_local else sized
            law = Law(scale * (size(there) ** 2).mean() * shape, noise)
            return draws(emulator, law, curve[None], rng)[0]

        found["data"] = np.array([own(curve, False) for curve in data])
        found["near"] = np.array([own(curve, True) for curve in data])
        for name, sample in found.items():
            ranks.setdefault(name, []).append((sample < truths[:, None]).mean(1))
            widths.setdefault(name, []).append(sample.std(1) / exact)
    for name in ("loo", "damped", "factor", "data", "near", "varying", "unknown"):
        centred = 2 * abs(np.concatenate(ranks[name]) - 0.5)
        shares = [100 * (centred < level).mean() for level in (0.5, 0.9, 0.95)]
        edges = 100 * (centred[::2] < 0.95).mean()
        width = np.median(np.concatenate(widths[name]))
        print(f"{model:10} {kind:5}{runs:4} {name:8}" + "".join(f"{s:6.1f}" for s in shares), f"edges {edges:5.1f}  width {width:5.2f}", flush=True)


if __name__ == "__main__":
    wanted = sys.argv[1:] or [f"{model}:{case}" for model in MODELS for case in CASES]
    print("model      emulator   covariance  50 %  90 %  95 %")
    for case in wanted:
        model, kind, runs = case.split(":")
        count(model, kind, int(runs))
