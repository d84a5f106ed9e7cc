"""Fetches the Silverbox benchmark and writes the tables of a part of its multisine record and of its arrow-shaped test
record. Standard library only.

    python3 fetch.py [a copy of SNLS80mV.csv]

Origin: T. Wigren, J. Schoukens, "Three free data sets for development and benchmarking in nonlinear system
identification", European Control Conference 2013 (nonlinearbenchmark.org). The copy's repository has the MIT licence; that of
the data is not stated.
"""
import hashlib
import pathlib
import sys
import urllib.request
from statistics import fmean

URL = ("https://raw.githubusercontent.com/biaslab/nsi-silverbox/728f07e4539d4f7da76a4778b52a756260b488ac/"
       "data/Silverbox/SNLS80mV.csv")
SHA256 = "ae62d5a91230c10f76e6dd02c8a4fac3c9d4d8a95fbf50e87cb0c4885003e0f1"
HERE = pathlib.Path(__file__).parent
RATE = 1e7 / 2**14                       # samples per second


def main():
    raw = pathlib.Path(sys.argv[1]).read_bytes() if len(sys.argv) > 1 else urllib.request.urlopen(URL, timeout=60).read()
    if hashlib.sha256(raw).hexdigest() != SHA256:
        sys.exit("this is another file than the one that the study was written for")
    rows = [line.split(",")[:2] for line in raw.decode().splitlines()[1:] if line.strip()]
    # The channels have offsets; the drive has mean zero by design (README of the benchmark).
    drive, voltage = ([float(row[k]) for row in rows] for k in (0, 1))
    drive, voltage = ([x - mean for x in column] for column, mean in ((drive, fmean(drive)), (voltage, fmean(voltage))))
    for name, first, count in (("multisine", 50000, 500), ("arrow", 0, 40000)):
        for kind, column, more in (("drive", drive, 1), ("voltage", voltage, 0)):
            with open(HERE / f"{kind}-{name}.csv", "w") as out:
                out.write(f"time [s],{kind} [V]\n")
                for i in range(count + more):
                    out.write(f"{i / RATE:.7f},{column[first + i]:.7f}\n")


main()
