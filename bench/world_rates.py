"""Rates of right and false names in the worlds of `bench/src/bin/worlds`, from the lines that `--random` printed.

    python bench/world_rates.py FILE...

A name is *right* if the verdict is `named`, `class` or `approximate`, every effect holds the type of a hidden cause in its class, and every
hidden cause is held; *false* if with such a verdict an effect is of no hidden cause; else *withheld* (`unlisted`, `none`, or a cause
that was not seen). Of physics inside the simulator, `probability.py` lists the types that are near to it. Intervals are 95 %
intervals of Clopper and Pearson. Needs only Python.
"""

import math
import sys

from probability import is_right

NAMED = ("Named", "Class", "Approximate")
GROUPS = ("one fault of the measuring chain", "two faults", "a fault and physics inside the simulator", "physics inside the simulator")


def tail(n, k, p):
    """The probability of at least `k` of `n`."""
    return sum(math.comb(n, i) * p ** i * (1 - p) ** (n - i) for i in range(k, n + 1))


def solved(increasing, target):
    low, high = 0.0, 1.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if increasing(middle) < target else (low, middle)
    return low


def interval(k, n):
    low = 0.0 if k == 0 else solved(lambda p: tail(n, k, p), 0.025)
    high = 1.0 if k == n else solved(lambda p: tail(n, k + 1, p), 0.975)
    return low, high


def judged(word, causes, classes):
    if word not in NAMED:
        return "withheld"
    if not all(any(is_right(cause, word, types) for cause in causes) for types in classes):
        return "false"
    held = all(any(is_right(cause, word, types) for types in classes) for cause in causes)
    return "right" if held else "withheld"


def group(causes):
    inside = sum(cause.startswith("inside:") for cause in causes)
    return (3 if len(causes) == 1 else 2) if inside else len(causes) - 1


def main(paths):
    counts = {name: {"right": 0, "false": 0, "withheld": 0} for name in GROUPS}
    kinds, times, false = {}, [], []
    for path in paths:
        with open(path) as file:
            lines = [line.rstrip("\n") for line in file if line.count("\t") >= 8]
        for line in lines:
            world, seed, _, hidden, ratio, word, _, _, seconds, *found = line.split("\t")
            causes = hidden.split(" & ")
            classes = [text.split(";")[0].split("@")[0].split("/") for text in found]
            verdict = judged(word, causes, classes)
            counts[GROUPS[group(causes)]][verdict] += 1
            times.append(float(seconds))
            for cause in causes:
                kind = cause.split("@")[0]
                kinds.setdefault(kind, []).append((word, verdict))
            if verdict == "false":
                false.append(f"{world} {seed}: {hidden} (rms {ratio}), {word}: {', '.join('/'.join(c) for c in classes)}")
    print("| hidden | cases | right | false | withheld | right of those named |\n|---|---|---|---|---|---|")
    for name, own in counts.items():
        told = own["right"] + own["false"]
        low, high = interval(own["right"], told) if told else (0.0, 1.0)
        share = f"{own['right']}/{told}, {100 * low:.1f} to {100 * high:.1f} %" if told else "none named"
        print(f"| {name} | {sum(own.values())} | {own['right']} | {own['false']} | {own['withheld']} | {share} |")
    print()
    for kind, all_of in sorted(kinds.items()):
        words = sorted({word for word, _ in all_of})
        text = ", ".join(f"{word} {sum(w == word for w, _ in all_of)}" for word in words)
        print(f"{kind}: {text}; right {sum(v == 'right' for _, v in all_of)}, false {sum(v == 'false' for _, v in all_of)}")
    times.sort()
    if times:
        print(f"\nseconds per case: median {times[len(times) // 2]:.1f}, largest {times[-1]:.1f}")
    print("\n".join(false))


if __name__ == "__main__":
    main(sys.argv[1:])
