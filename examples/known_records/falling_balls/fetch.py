"""Fetches the falling balls and writes height.csv of one ball, two drops. Standard library only.

    python3 fetch.py BALL [a copy of Ball_drops_data.xls]

BALL is the name of a sheet in small letters, such as volleyball or orange_whiffle_ball; a wrong one lists them. Origin: B. de Silva, D.
Higdon, S. Brunton, J. N. Kutz, Discovery of physics from data, Frontiers in Artificial Intelligence 3:25, 2020;
github.com/briandesilva/discovery-of-physics-from-data (MIT licence).
"""
import hashlib
import io
import pathlib
import sys
import urllib.request
import xml.etree.ElementTree as xml
import zipfile

URL = ("https://raw.githubusercontent.com/briandesilva/discovery-of-physics-from-data/"
       "b79c34317f049c9b47aaf2cc4c54c5ec7219f3d7/data/Ball_drops_data.xls")
SHA256 = "942b2d68abfff3828ca323de491435d4ec27c3a22e62cee0cbdf52c2e8d1c0ed"
MAIN = "{http://schemas.openxmlformats.org/spreadsheetml/2006/main}"
LINK = "{http://schemas.openxmlformats.org/officeDocument/2006/relationships}id"


def main():
    raw = pathlib.Path(sys.argv[2]).read_bytes() if len(sys.argv) > 2 else urllib.request.urlopen(URL, timeout=60).read()
    if hashlib.sha256(raw).hexdigest() != SHA256:
        sys.exit("this is another file than the one that the study was written for")
    # In spite of its name the file is a zipped workbook: one sheet for each ball.
    book = zipfile.ZipFile(io.BytesIO(raw))
    targets = {e.get("Id"): e.get("Target") for e in xml.fromstring(book.read("xl/_rels/workbook.xml.rels"))}
    sheets = {e.get("name").strip().lower().replace(" ", "_"): targets[e.get(LINK)]
              for e in xml.fromstring(book.read("xl/workbook.xml")).iter(MAIN + "sheet")}
    ball = sys.argv[1] if len(sys.argv) > 1 else ""
    if ball not in sheets:
        sys.exit("balls: " + ", ".join(sorted(sheets)))
    rows = list(xml.fromstring(book.read("xl/" + sheets[ball])).iter(MAIN + "row"))[1:]
    with open(pathlib.Path(__file__).parent / "height.csv", "w") as out:
        out.write("scenario,time [s],height [m]\n")
        for row in rows:
            cells = [cell.find(MAIN + "v") for cell in row]
            if len(cells) >= 3 and all(cell is not None for cell in cells[:3]):
                drop, time, height = (float(cell.text) for cell in cells[:3])
                out.write(f"drop{drop:g},{time:.6f},{height}\n")


main()
