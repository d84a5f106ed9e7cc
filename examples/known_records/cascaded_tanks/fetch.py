"""Fetches the record of the cascaded tanks and writes the tables of the study. Standard library only.

    python3 fetch.py [a folder with dataBenchmark.csv]

Origin: M. Schoukens, P. Mattsson, T. Wigren, J.-P. Noël, "Cascaded tanks benchmark combining soft and hard nonlinearities",
Workshop on Nonlinear System Identification Benchmarks, 2016 (nonlinearbenchmark.org). The copy is that of M. Forgione's repository
sysid-neural-continuous (Apache licence 2.0); the licence of the data is not stated, so they are fetched and not shipped.
"""
import csv
import hashlib
import io
import pathlib
import sys
import urllib.request

URL = ("https://raw.githubusercontent.com/forgi86/sysid-neural-continuous/956aa7ecd73061b0321c6f6098d74c9e4a7ce67a/"
       "examples/CTS/data/dataBenchmark.csv")
SHA256 = "ef2388ed822f3aef4aa80d6b0f2b466dd80b361786b3eafc7a2957c31ea323a7"
STEP = 4                                 # s between samples
EVERY = 2                                # samples between points of the study
HERE = pathlib.Path(__file__).parent


def main():
    raw = (pathlib.Path(sys.argv[1]) / "dataBenchmark.csv").read_bytes() if len(sys.argv) > 1 else urllib.request.urlopen(URL, timeout=60).read()
    if hashlib.sha256(raw).hexdigest() != SHA256:
        sys.exit("dataBenchmark.csv is another file than the one that the study was written for")
    rows = [row for row in csv.DictReader(io.StringIO(raw.decode())) if row["uEst"]]
    for name, u, y in (("estimation", "uEst", "yEst"), ("validation", "uVal", "yVal")):
        pump, level = [float(row[u]) for row in rows], [float(row[y]) for row in rows]
        with open(HERE / f"pump-{name}.csv", "w") as out:
            out.write("time [s],pump [V]\n")
            # A held voltage: the mean of the samples until the next point.
            for k in range(0, len(pump), EVERY):
                part = pump[k:k + EVERY]
                out.write(f"{STEP * k},{sum(part) / len(part):.5f}\n")
        with open(HERE / f"level-{name}.csv", "w") as out:
            out.write("time [s],level [V]\n")
            for k in range(EVERY, len(level), EVERY):
                out.write(f"{STEP * k},{level[k]:.5f}\n")


main()
