"""The direction of Mercury's perihelion from 1900 to 2200, as JPL's ephemeris DE421 has it, against the fixed stars.

Run: python3 examples/mercury_orbit/orbit.py examples/mercury_orbit (needs `pip install jplephem de421`)
"""

import csv
import math
import sys
from pathlib import Path

import de421
import numpy
from jplephem.ephem import Ephemeris

SUN = 132712440040.9446  # km3/s2: gravity of the sun
OBLIQUITY = math.radians(84381.448 / 3600)  # of the ecliptic of J2000
DAY = 86400.0  # s
YEARS = 5  # of which one value is the mean: the swings that the other planets cause nearly cancel


def heliocentric(days):
    """Positions (km) and velocities (km/s) of Mercury relative to the sun, in the ecliptic of J2000."""
    ephemeris = Ephemeris(de421)
    both = [ephemeris.position_and_velocity(body, days) for body in ("mercury", "sun")]
    place, velocity = both[0][0] - both[1][0], (both[0][1] - both[1][1]) / DAY
    c, s = math.cos(OBLIQUITY), math.sin(OBLIQUITY)
    turn = numpy.array([[1, 0, 0], [0, c, s], [0, -s, c]])
    return turn @ place, turn @ velocity


def perihelion(place, velocity):
    """Rotation of the perihelion in the plane of the orbit (arcseconds), from the angular momentum and eccentricity vectors."""
    momentum = numpy.cross(place, velocity, axis=0)
    distance = numpy.linalg.norm(place, axis=0)
    eccentric = numpy.cross(velocity, momentum, axis=0) / SUN - place / distance
    node = numpy.stack([-momentum[1], momentum[0], numpy.zeros_like(distance)])
    across = numpy.cross(momentum, node, axis=0) / numpy.linalg.norm(momentum, axis=0)
    argument = numpy.arctan2((eccentric * across).sum(0), (eccentric * node).sum(0))
    tilt = momentum[2] / numpy.linalg.norm(momentum, axis=0)
    turned = numpy.diff(numpy.unwrap(argument))
    turned += (tilt[1:] + tilt[:-1]) / 2 * numpy.diff(numpy.unwrap(numpy.arctan2(node[1], node[0])))
    return numpy.degrees(numpy.concatenate([[0.0], numpy.cumsum(turned)])) * 3600


first, last = 2415020.5, 2524593.5  # 1900 January 0, 2199 December 31
days = numpy.arange(first, last, 1.0)
years = (days - first) / 365.25
angle = perihelion(*heliocentric(days))
with open(Path(sys.argv[1]) / "perihelion.csv", "w", newline="") as file:
    table = csv.writer(file, lineterminator="\n")
    table.writerow(("replicate", "time", "perihelion"))
    for k in range(int(years[-1]) // YEARS):
        inside = (years >= k * YEARS) & (years < (k + 1) * YEARS)
        table.writerow((1, f"{years[inside].mean() / 100:.6f}", f"{angle[inside].mean():.4f}"))
