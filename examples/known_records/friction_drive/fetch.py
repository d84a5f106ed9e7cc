"""Fetches the record of an electro-mechanical positioning system (EMPS) and writes the tables of the study. Standard library only.

    python3 fetch.py [a folder with DATA_EMPS_SC.csv and DATA_EMPS_PULSES_SC.csv]

Origin: A. Janot, M. Gautier, M. Brunot, "Data set and reference models of EMPS", Workshop on Nonlinear System Identification
Benchmarks, 2019 (nonlinearbenchmark.org). The copy, every fifth sample, is that of M. Forgione's repository
sysid-neural-continuous (Apache licence 2.0); the licence of the data is not stated, so they are fetched and not shipped.
"""
import csv
import hashlib
import io
import pathlib
import sys
import urllib.request

URL = ("https://raw.githubusercontent.com/forgi86/sysid-neural-continuous/956aa7ecd73061b0321c6f6098d74c9e4a7ce67a/"
       "examples/EMPS/data/")
FILES = {
    "tracking": ("DATA_EMPS_SC.csv", "a7d9c26f534dbfe2d9d5fd6f1ffa328c809517397fa43a0e9185b37bd1844daa"),
    "pulses": ("DATA_EMPS_PULSES_SC.csv", "53d7bc31a2a83a17dd56f2f691964e9f7ce6d602dc26039fa8cb95d8e6de317b"),
}
GAIN = 35.1506                           # N/V: force of the drive for the voltage of its amplifier (data sheet of the benchmark)
STEP = 0.005                             # s between samples of the copy
EVERY = 8                                # samples between points of the study: 40 ms
HERE = pathlib.Path(__file__).parent


def main():
    for name, (file, sha256) in FILES.items():
        raw = (pathlib.Path(sys.argv[1]) / file).read_bytes() if len(sys.argv) > 1 else urllib.request.urlopen(URL + file, timeout=60).read()
        if hashlib.sha256(raw).hexdigest() != sha256:
            sys.exit(f"{file} is another file than the one that the study was written for")
        rows = list(csv.DictReader(io.StringIO(raw.decode())))
        position = [0.125 * (float(row["q_meas"]) + 1.0) for row in rows]     # the copy is scaled to -1 ... 1
        force = [GAIN * float(row["u_in"]) for row in rows]
        points = range(0, len(rows) - EVERY + 1, EVERY)
        with open(HERE / f"force-{name}.csv", "w") as out:
            out.write("time [s],force [N]\n")
            # A held force: the mean of the samples until the next point.
            for i in points:
                out.write(f"{STEP * i:g},{sum(force[i:i + EVERY]) / EVERY:.5f}\n")
        with open(HERE / f"position-{name}.csv", "w") as out:
            out.write("time [s],position [m]\n")
            for i in points[1:]:
                out.write(f"{STEP * i:g},{position[i] - position[0]:.8f}\n")


main()
