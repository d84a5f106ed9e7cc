"""Fetches the temperatures of a cooling mug of water and writes temperature.csv. Standard library only.

    python3 fetch.py [a copy of CoolingWater.rda]

Origin: data set CoolingWater of the R package mosaicData (GPL, version 2 or later), collected by Stan Wagon.
"""
import gzip
import hashlib
import pathlib
import struct
import sys
import urllib.request

URL = ("https://raw.githubusercontent.com/ProjectMOSAIC/mosaicData/"
       "5020909925e3daf6cb53073654d117be312e1a78/data/CoolingWater.rda")
SHA256 = "7562eb876f95cc5a58912f40b32f8a5fbef0e45868e0eded7a0ecc4dd7c5aaa1"


def main():
    raw = pathlib.Path(sys.argv[1]).read_bytes() if len(sys.argv) > 1 else urllib.request.urlopen(URL, timeout=60).read()
    if hashlib.sha256(raw).hexdigest() != SHA256:
        sys.exit("this is another file than the one that the study was written for")
    data = gzip.decompress(raw)
    # Two columns of 222 numbers in R's XDR format: the type 14 (real numbers), the length, big-endian doubles.
    columns, at = [], 0
    while (at := data.find(struct.pack(">i", 222), at)) >= 0:
        if data[at - 1] == 14:
            columns.append(struct.unpack(">222d", data[at + 4:at + 4 + 8 * 222]))
        at += 4
    time, temperature = columns
    with open(pathlib.Path(__file__).parent / "temperature.csv", "w") as out:
        out.write("time [min],temperature [degC]\n")
        for t, y in zip(time, temperature):
            out.write(f"{t:g},{y:g}\n")


main()
