"""Designs, truths and the answers of a peer for tests/fidelity.rs: `python peer.py > peer.json` with smt 2.15.0.

Functions: Forrester, Sobester and Keane, Proc. R. Soc. A 463 (2007) 3251 (`forrester`); Xiong, Qian and Wu,
Technometrics 55 (2013) 37, section 5 (`currin`, `park_a`, `park_b`, `borehole`). The peer is `MFK` of the Surrogate Modeling
Toolbox (recursive co-kriging after Le Gratiet and Garnier 2014) with its defaults but for three starts of its search, and
its `KRG` on fine runs alone.
"""

import json
import sys
import warnings

import numpy as np
import smt
from scipy.stats import qmc
from smt.applications.mfk import MFK
from smt.surrogate_models import KRG

warnings.filterwarnings("ignore")
CHEAPER = 10  # a fine run costs as much as ten cheap ones


def forrester(x):
    return (6 * x[:, 0] - 2) ** 2 * np.sin(12 * x[:, 0] - 4)


def forrester_low(x):
    return 0.5 * forrester(x) + 10 * (x[:, 0] - 0.5) - 5


def currin(x):
    a, b = x[:, 0], x[:, 1]
    with np.errstate(divide="ignore"):
        head = np.where(b > 0, 1 - np.exp(-1 / (2 * np.where(b > 0, b, 1))), 1.0)
    return head * (2300 * a**3 + 1900 * a**2 + 2092 * a + 60) / (100 * a**3 + 500 * a**2 + 4 * a + 20)


def currin_low(x):
    a, b = x[:, 0], x[:, 1]
    at = lambda da, db: currin(np.column_stack([a + da, np.maximum(0, b + db)]))
    return (at(0.05, 0.05) + at(0.05, -0.05) + at(-0.05, 0.05) + at(-0.05, -0.05)) / 4


def park_a(x):
    a, b, c, d = np.maximum(x[:, 0], 1e-8), x[:, 1], x[:, 2], x[:, 3]
    return a / 2 * (np.sqrt(1 + (b + c**2) * d / a**2) - 1) + (a + 3 * d) * np.exp(1 + np.sin(c))


def park_a_low(x):
    a, b, c = x[:, 0], x[:, 1], x[:, 2]
    return (1 + np.sin(a) / 10) * park_a(x) - 2 * a + b**2 + c**2 + 0.5


def park_b(x):
    return 2 / 3 * np.exp(x[:, 0] + x[:, 1]) - x[:, 3] * np.sin(x[:, 2]) + x[:, 2]


def park_b_low(x):
    return 1.2 * park_b(x) - 1


BOREHOLE = np.array([[0.05, 0.15], [100, 50000], [63070, 115600], [990, 1110],
                     [63.1, 116], [700, 820], [1120, 1680], [9855, 12045]])


def of_borehole(x, head, one):
    rw, r, tu, hu, tl, hl, length, kw = (BOREHOLE[:, 0] + x * (BOREHOLE[:, 1] - BOREHOLE[:, 0])).T
    log = np.log(r / rw)
    return head * tu * (hu - hl) / (log * (one + 2 * length * tu / (log * rw**2 * kw) + tu / tl))


def borehole(x):
    return of_borehole(x, 2 * np.pi, 1.0)


def borehole_low(x):
    return of_borehole(x, 5.0, 1.5)


def misleading(x):
    """A cheap response that has nothing to do with `park_b`."""
    return np.cos(9 * x[:, 0]) * np.sin(11 * x[:, 2]) + 3 * np.cos(13 * x[:, 1] * x[:, 3])


def lhs(n, d, seed):
    return qmc.LatinHypercube(d, seed=seed, optimization="random-cd").random(n)


def subset(points, n):
    """So many of the points, each the farthest from those taken before; the first is nearest to the centre."""
    taken = [int(np.argmin(((points - 0.5) ** 2).sum(1)))]
    while len(taken) < n:
        distance = ((points[:, None] - points[taken][None]) ** 2).sum(-1).min(1)
        taken.append(int(np.argmax(distance)))
    return points[taken]


CASES = [
    # name, fine, cheap, dimension, fine runs, cheap runs, nested
    ("forrester", forrester, forrester_low, 1, 4, 11, True),
    ("currin", currin, currin_low, 2, 12, 40, True),
    ("currin_apart", currin, currin_low, 2, 12, 40, False),
    ("park_a", park_a, park_a_low, 4, 20, 60, True),
    ("park_b", park_b, park_b_low, 4, 20, 60, True),
    ("borehole", borehole, borehole_low, 8, 20, 80, True),
    ("misleading", park_b, misleading, 4, 30, 60, True),
]


def error(predicted, truth):
    return float(np.sqrt(np.mean((predicted.ravel() - truth) ** 2)) / truth.std())


cases = []
for number, (name, fine, cheap, d, n_fine, n_cheap, nested) in enumerate(CASES):
    equal = n_fine + round(n_cheap / CHEAPER)
    if name == "forrester":
        low = np.linspace(0, 1, n_cheap)[:, None]
        high = np.array([[0.0], [0.4], [0.6], [1.0]])
        alone = np.linspace(0, 1, equal)[:, None]
        fresh = np.linspace(0, 1, 101)[:, None]
    else:
        low = lhs(n_cheap, d, 10 + number)
        high = subset(low, n_fine) if nested else lhs(n_fine, d, 20 + number)
        alone = lhs(equal, d, 30 + number)
        fresh = lhs(200, d, 40 + number)
    low, high, alone, fresh = (np.round(x, 9) for x in (low, high, alone, fresh))
    truth = fine(fresh)
    peer = MFK(theta0=[1.0] * d, print_global=False, seed=42, n_start=3)
    peer.set_training_values(low, cheap(low)[:, None], name=0)
    peer.set_training_values(high, fine(high)[:, None])
    peer.train()
    single = KRG(theta0=[1.0] * d, print_global=False, seed=42, n_start=3)
    single.set_training_values(alone, fine(alone)[:, None])
    single.train()
    few = lambda x: np.round(x, 12).tolist()
    print(name, file=sys.stderr, flush=True)
    cases.append({
        "name": name,
        "cheap": {"points": few(low), "values": few(cheap(low))},
        "fine": {"points": few(high), "values": few(fine(high))},
        "alone": {"points": few(alone), "values": few(fine(alone))},
        "fresh": {"points": few(fresh), "values": few(truth)},
        "smt": {"mfk": error(peer.predict_values(fresh), truth), "krg": error(single.predict_values(fresh), truth)},
    })

text = json.dumps({"smt": smt.__version__, "cases": cases})
print(text.replace('{"name"', '\n{"name"').replace('"cheap":', '\n"cheap":').replace('"fine":', '\n"fine":')
      .replace('"alone":', '\n"alone":').replace('"fresh":', '\n"fresh":').replace('"smt": {', '\n"smt": {'))
