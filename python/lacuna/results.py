"""Results of a run: summary, draws, emulator, posterior density."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _engine

if TYPE_CHECKING:
    import arviz
    import pandas
    import xarray


def load(folder: str | os.PathLike) -> Run:
    """The results of a finished run.

    Raises
    ------
    FileNotFoundError
        If the folder has no finished run.
    """
    run = Run(folder)
    run.summary  # noqa: B018  (reads the file, so that a wrong folder is refused here)
    return run


class Run:
    """A run directory. Everything is read when it is asked for."""

    def __init__(self, folder: str | os.PathLike) -> None:
        self.folder = Path(folder)

    def __repr__(self) -> str:
        return f"Run({str(self.folder)!r})"

    def _repr_html_(self) -> str:
        return f"<pre>{self.text}</pre>"

    @cached_property
    def summary(self) -> dict[str, Any]:
        """All figures of the run, as in ``summary.json``."""
        path = self.folder / "summary.json"
        if not path.exists():
            raise FileNotFoundError(f"{self.folder} has no finished run: there is no summary.json")
        return json.loads(path.read_text(encoding="utf-8"))

    @property
    def text(self) -> str:
        """Verdict and table of the parameters."""
        assessment = self.summary["assessment"]
        lines = [assessment["level"].replace("_", " ")]
        lines += [f"  {found['severity']}: {found['message']}" for found in assessment["findings"]]
        for name, value in self.summary.get("parameters", {}).items():
            unit = value.get("unit", "")
            lines.append(f"{name:<24} {value['mean']:>12.6g} ± {value['sd']:<10.3g} {unit}")
        return "\n".join(lines)

    @property
    def report(self) -> Path:
        """Path of the report."""
        return self.folder / "report.html"

    @cached_property
    def posterior(self) -> Posterior:
        """Draws of the posterior, and its density."""
        return Posterior(self)

    @cached_property
    def emulator(self) -> Emulator:
        """The surrogate of the model."""
        return Emulator(self._functions, "emulator")

    @cached_property
    def model(self) -> Emulator:
        """The model itself."""
        return Emulator(self._functions, "model")

    def predict(self, points: Any = None, *, draws: int = 400, seed: int = 0) -> Predictive:
        """Predict what a new replicate would measure: the response of the model with the study's effects, and the errors
        of its discrepancy around it, with those of emulator and numerics.

        Parameters
        ----------
        points
            Values of all unknowns: a dictionary of numbers or arrays, or an array with the unknowns as columns. Default:
            draws of the posterior, so that the prediction contains its uncertainty.
        draws
            Number of draws of the posterior, evenly spaced over all chains.
        seed
            Seed of the random numbers of the errors.

        Raises
        ------
        ValueError
            If the study has no measurements and discrepancy, or its likelihood is estimated or cut.
        """
        functions = self._functions
        if points is None:
            names = [name for name, _ in functions.variables("replicate")]
            table = self.posterior.to_pandas()[names].to_numpy()
            count = min(draws, len(table))
            points = table[((2 * np.arange(count) + 1) * len(table)) // (2 * count)]
        rows, single = _points(points, functions.variables("replicate"))
        shape = _shape(functions, "replicate") if single else (len(rows), *_shape(functions, "replicate"))
        response = functions.values("replicate", rows.tobytes())
        replicate = functions.replicates("replicate", rows.tobytes(), seed)
        return Predictive(*(np.frombuffer(table).reshape(shape) for table in (response, replicate)))

    @cached_property
    def _functions(self) -> _engine.Functions:
        return _engine.Functions(os.fspath(self.folder))

    def to_inference_data(self) -> arviz.InferenceData:
        """Everything in ``posterior.nc`` as ArviZ takes it; see the documentation of the run directory for its groups."""
        import arviz

        return arviz.from_netcdf(self.folder / "posterior.nc")

    def to_xarray(self, group: str = "posterior") -> xarray.Dataset:
        """One group of ``posterior.nc``, by default the draws."""
        import xarray

        return xarray.load_dataset(self.folder / "posterior.nc", group=group)

    def to_pandas(self) -> pandas.DataFrame:
        """Table of the parameters: mean, sd, quantiles, diagnostics."""
        import pandas

        parameters = self.summary.get("parameters", {})
        plain = {
            name: {key: value for key, value in found.items() if not isinstance(value, (dict, list))}
            for name, found in parameters.items()
        }
        return pandas.DataFrame.from_dict(plain, orient="index")


class Posterior:
    """Draws of the posterior after the burn-in, and its log density."""

    def __init__(self, run: Run) -> None:
        self._run = run

    @cached_property
    def draws(self) -> xarray.Dataset:
        """The draws, ``chain`` x ``draw``, with units as attributes."""
        return self._run.to_xarray("posterior")

    @property
    def names(self) -> list[str]:
        """Parameters and hyperparameters."""
        return list(self.draws.data_vars)

    def to_numpy(self) -> np.ndarray:
        """The draws of all chains, ``draws x unknowns``."""
        return np.column_stack([self.draws[name].values.ravel() for name in self.names])

    def to_pandas(self) -> pandas.DataFrame:
        """The draws of all chains, a column for each unknown."""
        import pandas

        return pandas.DataFrame(self.to_numpy(), columns=self.names)

    def mean(self) -> dict[str, float]:
        """Posterior means."""
        return {name: float(self.draws[name].mean()) for name in self.names}

    def sd(self) -> dict[str, float]:
        """Posterior standard deviations."""
        return {name: float(self.draws[name].std()) for name in self.names}

    def log_density(self, points: Any) -> np.ndarray:
        """Log posterior density at points: a dictionary of numbers or arrays, or an array with the unknowns as columns."""
        functions = self._run._functions
        rows, single = _points(points, functions.variables("posterior"))
        values = np.frombuffer(functions.values("posterior", rows.tobytes()))
        # The smallest number stands for a density of zero.
        values = np.where(values <= np.finfo(float).min, -np.inf, values)
        return values[0] if single else values


@dataclass(frozen=True)
class Prediction:
    """A predicted response.

    Attributes
    ----------
    mean
        Response, with the shape of the response; several points come first.
    sd
        Standard deviation of the emulator's error, alike; None for a model.
    """

    mean: np.ndarray
    sd: np.ndarray | None


@dataclass(frozen=True)
class Predictive:
    """Predictions of new replicates.

    Attributes
    ----------
    response
        Response at each point, with the study's effects and without errors; the points come first.
    replicate
        A new replicate at each point, alike: the response with random errors.
    """

    response: np.ndarray
    replicate: np.ndarray

    @property
    def mean(self) -> np.ndarray:
        """Mean of the replicates over the points."""
        return self.replicate.mean(axis=0)

    @property
    def sd(self) -> np.ndarray:
        """Standard deviation of the replicates over the points."""
        return self.replicate.std(axis=0)

    def quantile(self, probability: float) -> np.ndarray:
        """Quantile of the replicates over the points."""
        return np.quantile(self.replicate, probability, axis=0)


class Emulator:
    """A function from the parameters to the response: the surrogate of a run, or its model."""

    def __init__(self, functions: _engine.Functions, name: str) -> None:
        self._functions, self._name = functions, name
        self.parameters = [variable for variable, _ in functions.variables(name)]
        self.units = dict(functions.variables(name))
        self.layouts: list[dict[str, Any]] = json.loads(functions.layouts)

    def __repr__(self) -> str:
        return f"<{self._name} of {', '.join(self.parameters)}>"

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the response: that of its axes, or the number of its values if the scenarios have different axes."""
        return _shape(self._functions, self._name)

    def predict(self, points: Any) -> Prediction:
        """Predict the response at points.

        Parameters
        ----------
        points
            A dictionary of numbers or arrays by parameter, or an array with the parameters as columns. Outside of the
            region in which the emulator was fitted the response is NaN.
        """
        rows, single = _points(points, self._functions.variables(self._name))

        def shaped(table: bytes | None) -> np.ndarray | None:
            if table is None:
                return None
            return np.frombuffer(table).reshape(self.shape if single else (len(rows), *self.shape))

        points = rows.tobytes()
        mean = self._functions.values(self._name, points)
        return Prediction(shaped(mean), shaped(self._functions.deviations(self._name, points)))

    def gradient(self, point: Any) -> np.ndarray:
        """Derivative of the response by each parameter at a point; the parameters are the last axis.

        Raises
        ------
        ValueError
            If the function has no exact derivatives.
        """
        rows, single = _points(point, self._functions.variables(self._name))
        if not single:
            raise ValueError("the gradient is that at one point")
        jacobian = self._functions.jacobian(self._name, rows[0].tobytes())
        if jacobian is None:
            raise ValueError(f"the {self._name} has no exact derivatives")
        return np.frombuffer(jacobian).reshape(*self.shape, len(self.parameters))


def _shape(functions: _engine.Functions, name: str) -> tuple[int, ...]:
    layouts = json.loads(functions.layouts)
    if len(layouts) > 1:
        return (functions.outputs(name),)
    return tuple(_length(axis) for axis in layouts[0]["axes"])


def _length(axis: Mapping[str, Any]) -> int:
    coordinates = axis["coordinates"]
    values = next(iter(coordinates.values()))
    if isinstance(values, Mapping):
        values = values["values"]
    return len(values)


def _points(points: Any, variables: list[tuple[str, str]]) -> tuple[np.ndarray, bool]:
    """Points as rows, and True for a single one."""
    names = [name for name, _ in variables]
    if isinstance(points, Mapping):
        unknown = [name for name in points if name not in names]
        missing = [name for name in names if name not in points]
        if unknown or missing:
            raise ValueError(f"expected values of {', '.join(names)}, found {', '.join(map(str, points))}")
        columns = np.broadcast_arrays(*(np.asarray(points[name], dtype=float) for name in names))
        single = columns[0].ndim == 0
        return np.column_stack([column.ravel() for column in columns]), single
    array = np.asarray(points, dtype=float)
    if array.ndim not in (1, 2) or array.shape[-1] != len(names):
        raise ValueError(f"expected an array with the columns {', '.join(names)}, found the shape {array.shape}")
    return np.ascontiguousarray(np.atleast_2d(array)), array.ndim == 1
