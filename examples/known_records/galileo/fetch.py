"""Fetches the record of a pendulum and writes the first swings, angle.csv. Standard library only.

    python3 fetch.py [a copy of data2_17.csv]

Origin: repository y-fysiks/PHY180-Pendulum-datafit on GitHub, Lab2/data2_17.csv, a student's laboratory (PHY180,
University of Toronto). A rotary encoder wrote a line at each of its steps of 2 pi / 2400. The repository states no licence,
so the data are fetched and not shipped.
"""
import bisect
import hashlib
import pathlib
import sys
import urllib.request

URL = ("https://raw.githubusercontent.com/y-fysiks/PHY180-Pendulum-datafit/607a0fafc48f12cd7b45685ad47a92ae14e8dc61/"
       "Lab2/data2_17.csv")
SHA256 = "fac126c38297fa05cc92ca9f567ffb02c7899cc35d0629e7795ddac206f7b6a5"
FIRST, LAST, STEP = 8.5135, 53.5, 0.15  # s: from a turning point on


def main():
    raw = pathlib.Path(sys.argv[1]).read_bytes() if len(sys.argv) > 1 else urllib.request.urlopen(URL, timeout=60).read()
    if hashlib.sha256(raw).hexdigest() != SHA256:
        sys.exit("this is another file than the one that the study was written for")
    rows = [tuple(map(float, line.split(","))) for line in raw.decode().splitlines()[1:] if line.count(",") == 1]
    times = [t for t, _ in rows]
    with open(pathlib.Path(__file__).parent / "angle.csv", "w") as out:
        out.write("time [s],angle [1]\n")
        before = -1
        for i in range(round((LAST - FIRST) / STEP) + 1):
            k = bisect.bisect_left(times, FIRST + i * STEP)
            # The encoder has just passed from one step to the next: the angle is the mean of both.
            if before < k < len(rows) and times[k] > times[max(before, 0)]:
                out.write(f"{times[k] - FIRST:.6f},{(rows[k - 1][1] + rows[k][1]) / 2:.6f}\n")
                before = k


main()
