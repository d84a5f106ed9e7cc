"""Fetches the record of a pendulum and writes the amplitude of each swing, amplitude.csv. Standard library only.

    python3 fetch.py [a copy of data2_17.csv]

Origin: repository y-fysiks/PHY180-Pendulum-datafit on GitHub, Lab2/data2_17.csv, a student's laboratory (PHY180,
University of Toronto). A rotary encoder wrote a line at each of its steps of 2 pi / 2400. The repository states no licence,
so the data are fetched and not shipped.
"""
import hashlib
import pathlib
import sys
import urllib.request

URL = ("https://raw.githubusercontent.com/y-fysiks/PHY180-Pendulum-datafit/607a0fafc48f12cd7b45685ad47a92ae14e8dc61/"
       "Lab2/data2_17.csv")
SHA256 = "fac126c38297fa05cc92ca9f567ffb02c7899cc35d0629e7795ddac206f7b6a5"
FIRST, LAST = 8.0, 160.0                 # s: the hand is off; the swings are above 12 steps of the encoder


def main():
    raw = pathlib.Path(sys.argv[1]).read_bytes() if len(sys.argv) > 1 else urllib.request.urlopen(URL, timeout=60).read()
    if hashlib.sha256(raw).hexdigest() != SHA256:
        sys.exit("this is another file than the one that the study was written for")
    rows = [tuple(map(float, line.split(","))) for line in raw.decode().splitlines()[1:] if line.count(",") == 1]
    # The largest deflection on each side, between two passages of the middle.
    turns, best = [], None
    for t, x in rows:
        if best is not None and x * best[1] < 0:
            turns.append(best)
            best = None
        if best is None or abs(x) > abs(best[1]):
            best = (t, x)
    with open(pathlib.Path(__file__).parent / "amplitude.csv", "w") as out:
        out.write("time [s],amplitude [1]\n")
        # Half the way from one turning point to the next: the zero of the encoder does not matter.
        for (t, x), (t2, x2) in zip(turns[::2], turns[1::2]):
            if FIRST < t < LAST:
                out.write(f"{(t + t2) / 2 - FIRST:.4f},{abs(x2 - x) / 2:.6f}\n")


main()
