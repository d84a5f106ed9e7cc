"""A round steel billet that cools in air: a typical simulator, a program with an input deck.

    python3 billet.py billet.deck

Heat flows to the surface by conduction and leaves it by radiation and convection:

    c dT/dt = 1/r d/dr (k r dT/dr)                                              inside, c per volume,
    -k dT/dr = e s (T^4 - A^4) + h (T - A)                                      at the surface, A the air's temperature.

Finite volumes along the radius, backward Euler in time. The boundary condition is nonlinear: each step iterates a linear
solution until the surface temperature has converged, and ends the program with code 3 if that takes more than
`iterations`. Units: m, kg, s, K, W. The deck has one `name = value` per line; `include FILE` reads another deck.
"""

import os
import sys

STEFAN_BOLTZMANN = 5.670374419e-8
NAMES = (
    *("diameter", "density", "heat_capacity", "conductivity", "emissivity", "film", "furnace", "air"),
    *("cells", "step", "end", "tolerance", "iterations"),
)
PLACES = {"axis": 0.0, "half": 0.5, "skin": 0.95}


def entries(path):
    """Settings of a deck and of all decks that it includes."""
    found = {}
    with open(path, encoding="utf-8") as lines:
        for number, line in enumerate(lines, 1):
            words = line.partition("#")[0].split()
            if not words:
                continue
            if words[0] == "include" and len(words) == 2:
                found |= entries(os.path.join(os.path.dirname(path), words[1]))
            elif len(words) == 3 and words[1] == "=" and words[0] in NAMES:
                found[words[0]] = float(words[2])
            else:
                sys.exit(f"{path}, line {number}: expected `name = value` or `include FILE`: {line.strip()}")
    return found


def read(path):
    """A complete deck."""
    deck = entries(path)
    missing = [name for name in NAMES if name not in deck]
    if missing:
        sys.exit(f"{path}: nothing sets {', '.join(missing)}")
    return deck


def tridiagonal(lower, diagonal, upper, right):
    """The solution of a tridiagonal system by elimination."""
    pivots, rights = [diagonal[0]], [right[0]]
    for i in range(1, len(diagonal)):
        factor = lower[i] / pivots[-1]
        pivots.append(diagonal[i] - factor * upper[i - 1])
        rights.append(right[i] - factor * rights[-1])
    solution = [rights[-1] / pivots[-1]]
    for i in range(len(diagonal) - 2, -1, -1):
        solution.append((rights[i] - upper[i] * solution[-1]) / pivots[i])
    return solution[::-1]


class Billet:
    """Temperatures of the cells, from the axis to the surface, and the system of equations of one step."""

    def __init__(self, deck):
        self.deck = deck
        cells, radius = int(deck["cells"]), deck["diameter"] / 2
        self.width = radius / cells
        faces = [i * self.width for i in range(cells + 1)]
        heat = deck["density"] * deck["heat_capacity"] / deck["step"]
        # Each cell is a ring; all areas and volumes are divided by 2 pi and the length.
        self.held = [heat * (b * b - a * a) / 2 for a, b in zip(faces, faces[1:])]
        self.links = [0.0] + [deck["conductivity"] * face / self.width for face in faces[1:-1]] + [0.0]
        self.temperatures = [deck["furnace"]] * cells
        self.surface = deck["furnace"]
        self.radius = radius

    def advance(self, number):
        """One step in time."""
        deck, air, before = self.deck, self.deck["air"], self.temperatures
        diagonal = [held + a + b for held, a, b in zip(self.held, self.links, self.links[1:])]
        lower = [-link for link in self.links[:-1]]
        upper = [-link for link in self.links[1:]]
        right = [held * temperature for held, temperature in zip(self.held, before)]
        inside = 2 * deck["conductivity"] / self.width
        for _ in range(int(deck["iterations"])):
            surface = self.surface
            radiation = STEFAN_BOLTZMANN * (surface**2 + air**2) * (surface + air)
            outside = deck["emissivity"] * radiation + deck["film"]
            loss = self.radius * inside * outside / (inside + outside)
            last = [*right[:-1], right[-1] + loss * air]
            self.temperatures = tridiagonal(lower, [*diagonal[:-1], diagonal[-1] + loss], upper, last)
            self.surface = (inside * self.temperatures[-1] + outside * air) / (inside + outside)
            change = abs(self.surface - surface)
            if change <= deck["tolerance"]:
                return
        print(
            f"no convergence in step {number}: the surface still moves by {change:.1e} K after "
            f"{deck['iterations']:.0f} iterations, {deck['tolerance']:.0e} K is allowed",
            file=sys.stderr,
        )
        sys.exit(3)

    def at(self, share):
        """Temperature at a fraction of the radius, interpolated between the centres of the cells."""
        place = share * len(self.temperatures) - 0.5
        i = min(max(int(place), 0), len(self.temperatures) - 2)
        a, b = self.temperatures[i : i + 2]
        return a + max(place - i, 0.0) * (b - a)


def simulate(deck, every=300.0):
    """Yields the time and the temperature at each position, every `every` seconds."""
    billet = Billet(deck)
    steps = round(every / deck["step"])
    for number in range(1, round(deck["end"] / deck["step"]) + 1):
        billet.advance(number)
        if number % steps == 0:
            yield number * deck["step"], {name: billet.at(share) for name, share in PLACES.items()}


if __name__ == "__main__":
    rows = list(simulate(read(sys.argv[1])))
    with open("temperature.csv", "w", encoding="utf-8") as file:
        file.write("place,time [s],temperature [K]\n")
        for name in PLACES:
            file.writelines(f"{name},{time:g},{found[name]:.6f}\n" for time, found in rows)
    print("normal termination")
