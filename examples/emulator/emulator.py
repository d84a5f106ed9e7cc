"""The emulator in a file that `lacuna convert RUN emulator.nc` wrote, with NumPy and SciPy's reader of netCDF alone."""

import sys

import numpy as np
from scipy.io import netcdf_file


class Emulator:
    def __init__(self, path):
        with netcdf_file(path, mmap=False) as file:
            texts = {name: value.decode() for name, value in file._attributes.items() if isinstance(value, bytes)}
            self.numbers = {name: np.array(variable[:], float) for name, variable in file.variables.items()}
        self.parameters = texts["parameters"].split()
        self.shape = tuple(int(length) for length in texts["shape"].split())
        self.kernel = texts.get("kernel")

    def predict(self, points):
        """Mean of the response at points (points x parameters); NaN outside of the region of the emulator."""
        points = np.atleast_2d(np.asarray(points, float))
        values = self._polynomials(points) @ self.numbers["coefficient"]
        if self.kernel:
            values += self._processes(points)
        if "loading" in self.numbers:
            values = self.numbers["offset"] + values @ self.numbers["loading"]
        outside = (points < self.numbers["low"]) | (points > self.numbers["high"])
        values[outside.any(axis=1)] = np.nan
        return values.reshape(len(points), *self.shape)

    def _standard(self, points, of):
        log, centre, scale = (self.numbers[of + name] for name in ("log", "centre", "scale"))
        return (np.where(log == 1, np.log(np.maximum(points, np.finfo(float).tiny)), points) - centre) / scale

    def _polynomials(self, points):
        z = np.clip(self._standard(points, ""), -self.numbers["bound"], self.numbers["bound"])
        centre, size = self.numbers["recurrence_centre"], self.numbers["recurrence_size"]
        table = [np.ones_like(z)]
        for n in range(size.shape[1]):
            before = size[:, n - 1] * table[n - 1] if n else 0.0
            table.append(((z - centre[:, n]) * table[n] - before) / size[:, n])
        table, exponent = np.array(table), self.numbers["exponent"].astype(int)
        return np.prod([table[exponent[:, k], :, k] for k in range(z.shape[1])], axis=0).T

    def _processes(self, points):
        differences = self._standard(points, "run_")[:, None] - self.numbers["run"]
        distances = (np.linalg.norm(differences / scale, axis=2) for scale in self.numbers["length_scale"])
        return np.column_stack([self._correlation(r) @ w for r, w in zip(distances, self.numbers["weight"].T)])

    def _correlation(self, r):
        if self.kernel == "squared_exponential":
            return np.exp(-0.5 * r**2)
        a = np.sqrt(5.0 if self.kernel == "matern_5_2" else 3.0) * r
        return (1 + a + (a**2 / 3 if self.kernel == "matern_5_2" else 0)) * np.exp(-a)


if __name__ == "__main__":
    emulator = Emulator(sys.argv[1])
    print(emulator.predict([[float(x) for x in sys.argv[2:]]])[0])
