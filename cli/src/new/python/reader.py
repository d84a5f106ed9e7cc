"""`skeleton`: measurements in columns."""

import csv
from pathlib import Path

import lacuna
import numpy as np


@lacuna.reader("skeleton")
class Skeleton:
    """A table without a header: one column per replicate, one row per value of the response; an empty cell is missing."""

    path: str = lacuna.option(doc="Path of the table, relative to the study.")

    def measurements(self, folder, layout):
        with open(Path(folder) / self.path, newline="") as file:
            rows = [[float(cell) if cell else np.nan for cell in row] for row in csv.reader(file)]
        return np.array(rows).T
