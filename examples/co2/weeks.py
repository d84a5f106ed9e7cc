"""Weekly carbon dioxide of the air on Mauna Loa, 1990 to 1999, from the package statsmodels (Keeling and Whorf).

Run: python3 examples/co2/weeks.py examples/co2 (needs `pip install statsmodels`)
"""

import csv
import sys
from pathlib import Path

from statsmodels.datasets import co2

FIRST, LAST = 1990, 1999

weeks = co2.load().data["co2"].dropna()
weeks = weeks[(weeks.index.year >= FIRST) & (weeks.index.year <= LAST)]
with open(Path(sys.argv[1]) / "co2.csv", "w", newline="") as file:
    table = csv.writer(file, lineterminator="\n")
    table.writerow(("replicate", "time", "co2 [ppm]"))
    for day, value in weeks.items():
        years = (day - weeks.index[0].replace(year=FIRST, month=1, day=1)).days / 365.25
        table.writerow((1, f"{years:.6f}", f"{value:.2f}"))
