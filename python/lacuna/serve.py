"""The methods of a plugin as the program calls them, kind by kind.

A server has a method for each call, with the head of the message, its matrices and its bytes; it returns an answer in
JSON, or such an answer with matrices and bytes. What a method of a plugin is given is decided by the names of its
arguments: it receives those that it names.
"""

import inspect
import pickle

import numpy as np

from . import plugin


class Wrong(Exception):
    """A result of a plugin that is of the wrong form."""


class Made:
    """An object that a call made, with what the program must know of it."""

    def __init__(self, server, about):
        self.server, self.about = server, about


class Axis:
    """An axis of a response: `labels`, or `values` with a `unit`."""

    def __init__(self, about):
        self.name, place = about["name"], about["coordinates"]
        self.labels = place.get("labels")
        grid = place.get("grid", {})
        self.values = np.array(grid["values"]) if grid else None
        self.unit = grid.get("unit")

    def __len__(self):
        return len(self.labels if self.values is None else self.values)


class Layout:
    """The form of a response: `name`, `unit`, `axes` and `shape`; `grid` holds the values of the last axis."""

    def __init__(self, about):
        self.name, self.unit = about["name"], about["unit"]
        self.axes = [Axis(axis) for axis in about["axes"]]
        self.shape = tuple(len(axis) for axis in self.axes)
        self.size = int(np.prod(self.shape, dtype=int))

    @property
    def grid(self):
        return self.axes[-1].values if self.axes else None


def known(about):
    """Conditions that many calls share: names, layout and scenario."""
    scenario = about.get("scenario")
    if scenario:
        values = {given["name"]: given["value"] for given in scenario.get("values", ())}
        functions = {given["name"]: given for given in scenario.get("functions", ())}
        scenario = {**scenario, "values": values, "functions": functions}
    return {"names": about["names"], "layout": Layout(about["layout"]), "scenario": scenario}


def generator(key):
    """The random numbers of a stream of the program."""
    return np.random.Generator(np.random.Philox(np.random.SeedSequence(key)))


def called(method, **given):
    """Calls a method with those of the arguments that it names."""
    function = getattr(method, "__func__", method)
    takes = _TAKES.get(function)
    if takes is None:
        parameters = list(inspect.signature(function).parameters.values())
        everything = any(p.kind is p.VAR_KEYWORD for p in parameters)
        names = {p.name for p in parameters}
        missing = [
            p.name for p in parameters
            if p.default is p.empty and p.kind in (p.POSITIONAL_OR_KEYWORD, p.KEYWORD_ONLY)
            and p.name not in given and p.name != "self"
        ]
        if missing:
            known = ", ".join(f"`{name}`" for name in given)
            raise Wrong(f"`{function.__name__}` has an argument `{missing[0]}`, which is none of {known}")
        takes = _TAKES[function] = None if everything else names
    if takes is None:
        return method(**given)
    return method(**{name: value for name, value in given.items() if name in takes})


_TAKES = {}


def array(value, shape, what):
    """The numbers of a result in the shape that it must have."""
    try:
        numbers = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        raise Wrong(f"`{what}` returns {value!r:.60}, expected numbers") from None
    if numbers.shape != shape:
        if numbers.size != int(np.prod(shape, dtype=int)) or numbers.ndim > 1 and len(shape) > 1 and numbers.shape[0] != shape[0]:
            raise Wrong(f"`{what}` returns an array of shape {numbers.shape}, expected {shape}")
        numbers = numbers.reshape(shape)
    return numbers


def named(names, rows):
    """A dictionary of the columns of a matrix."""
    return {name: rows[:, j] for j, name in enumerate(names)}


class Server:
    """What the servers of all kinds have in common."""

    # Methods of a plugin that it may leave out.
    OPTIONAL = ()

    def __init__(self, made, channel):
        self.plugin, self.channel = made, channel

    @classmethod
    def has(cls, of):
        """The optional methods and attributes that a class has."""
        missing = [name for name in cls.NEEDED if not callable(getattr(of, name, None))]
        if missing:
            raise Wrong(f"the class `{of.__name__}` has no method `{missing[0]}`")
        return [name for name in cls.OPTIONAL if getattr(of, name, None) is not None]

    def _has(self, name):
        return getattr(self.plugin, name, None) is not None

    def check(self, head, matrices, data):
        """The plugin's own check of its options against the study."""
        called(self.plugin.check, study=head["context"])
        return None


class ModelServer(Server):
    NEEDED, OPTIONAL = ("predict",), ("check", "gradient")

    def signature(self, head, matrices, data):
        inputs = getattr(self.plugin, "inputs", None)
        if inputs is None:
            return {}
        if not isinstance(inputs, dict):
            inputs = {name: {} for name in inputs}
        texts = {name: {"unit": about} if isinstance(about, str) else about for name, about in inputs.items()}
        return {"inputs": [{"name": name, "unit": "1", **about} for name, about in texts.items()]}

    def _given(self, head, points):
        layout = head["layout"]
        return layout, {"inputs": named(head["names"], points), "layout": layout, "scenario": head["scenario"]}

    def predict(self, head, matrices, data):
        layout, given = self._given(head, matrices[0])
        runs = len(matrices[0])
        try:
            return [None] * runs, [array(called(self.plugin.predict, **given), (runs, layout.size), "predict")], b""
        except Exception as error:
            if runs == 1:
                if not isinstance(error, (plugin.Rejected, ArithmeticError, ValueError)):
                    raise
                return [f"{error}"], [np.full((1, layout.size), np.nan)], b""
        alone = [self.predict(head, [row[None, :]], data) for row in matrices[0]]
        return [said for saids, _, _ in alone for said in saids], [np.vstack([rows[0] for _, rows, _ in alone])], b""

    def gradient(self, head, matrices, data):
        layout, given = self._given(head, matrices[0])
        names = head["names"]
        slopes = called(self.plugin.gradient, **given)
        if isinstance(slopes, dict):
            slopes = np.stack([array(slopes[name], (layout.size,), "gradient") for name in names], axis=-1)
        return None, [array(slopes, (layout.size, len(names)), "gradient")], b""


class QuantityServer(Server):
    NEEDED, OPTIONAL = ("value",), ("check", "of_numbers")

    def bind(self, head, matrices, data):
        about = head["arguments"]
        curve, numbers = about.get("curve"), about.get("numbers")
        given = {"unit": curve["unit"], "grid_unit": curve["grid_unit"]} if curve else {"unit": "1"}
        unit = getattr(self.plugin, "unit", given["unit"])
        unit = called(unit, **given) if callable(unit) else unit
        return Made(FunctionalServer(self.plugin, curve, numbers), str(unit))


class FunctionalServer:
    def __init__(self, made, curve, numbers):
        self.plugin, self.numbers = made, numbers
        self.grid = np.array(curve["grid"]) if curve else None

    def value(self, head, matrices, data):
        row = matrices[0][0]
        if self.numbers is None:
            given = {"curve": row, "grid": self.grid}
        else:
            given = {"numbers": {about["name"]: x for about, x in zip(self.numbers, row)}}
        return None, [array(called(self.plugin.value, **given), (1,), "value")], b""


class EffectServer(Server):
    NEEDED, OPTIONAL = ("unknowns", "apply"), ("check", "starts", "proposals")

    def describe(self, head, matrices, data):
        texts = {name: getattr(self.plugin, name, "") for name in ("formula", "source")}
        title = getattr(self.plugin, "title", "") or type(self.plugin).__name__
        reach = getattr(self.plugin, "reach", "any")
        return {"title": title, **texts, "reach": reach, "absent": float(getattr(self.plugin, "absent", 0.0))}

    def unknowns(self, head, matrices, data):
        return called(self.plugin.unknowns, layout=head["layout"])

    def apply(self, head, matrices, data):
        layout, names = head["layout"], self._names(head["layout"])
        values = {name: float(x) for name, x in zip(names, matrices[1][0])}
        response = matrices[0].reshape(layout.shape)
        changed = called(self.plugin.apply, response=response, values=values, layout=layout)
        return None, [array(changed, layout.shape, "apply").reshape(1, -1)], b""

    def _names(self, layout):
        # A layout stays the same object for as long as calls with it come.
        if self.__dict__.get("_for") is not layout:
            self._for, self._named = layout, [u["name"] for u in called(self.plugin.unknowns, layout=layout)]
        return self._named

    def starts(self, head, matrices, data):
        layout = head["layout"]
        rows = called(self.plugin.starts, layout=layout, response=matrices[0][0], noise=matrices[1][0])
        rows = [[float(row[name]) for name in head["names"]] for row in rows]
        return None, [np.array(rows, dtype=float).reshape(len(rows), len(head["names"]))], b""

    def proposals(self, head, matrices, data):
        layouts = [Layout(about) for about in head["layouts"]]
        return called(self.plugin.proposals, layouts=layouts, response=matrices[0][0], noise=matrices[1][0])


class Data:
    """The measurements of a likelihood, one row a replicate, NaN where nothing was measured."""

    def __init__(self, head, matrices):
        self.layout, self.replicates = Layout(head["layout"]), head["replicates"]
        self.values, stated, self.covariance, *factors = matrices
        self.sd = stated if len(stated) else None
        self.covariance = self.covariance if len(self.covariance) else None
        measured = ~np.isnan(self.values)
        self.count = measured.sum(axis=0)
        with np.errstate(invalid="ignore", divide="ignore"):
            self.mean = np.where(self.count > 0, np.nansum(self.values, axis=0) / self.count, np.nan)
        # Factors F of covariances F F' of errors that all replicates share, with their origin.
        self.common = [(about["origin"], factor) for about, factor in zip(head["common"], factors)]
        # Those of them that a new replicate has too.
        self.predictive = [pair for pair, about in zip(self.common, head["common"]) if about["predictive"]]


class DiscrepancyServer(Server):
    NEEDED = ("unknowns", "log_likelihood", "variance")
    OPTIONAL = ("check", "gradient", "simulate", "takes_stated_noise")

    def likelihood(self, head, matrices, data):
        served = LikelihoodServer(self.plugin, Data(head, matrices))
        return Made(served, called(self.plugin.unknowns, data=served.data))


class LikelihoodServer:
    def __init__(self, made, data):
        self.plugin, self.data = made, data
        prepare = getattr(made, "prepare", None)
        self.prepared = called(prepare, data=data) if prepare else None

    def _given(self, names, responses, hyper):
        return {"response": responses, "unknowns": named(names, hyper), "data": self.data, "prepared": self.prepared}

    def log_likelihood(self, head, matrices, data):
        values = called(self.plugin.log_likelihood, **self._given(head["names"], *matrices))
        return None, [array(values, (len(matrices[0]),), "log_likelihood")], b""

    def gradient(self, head, matrices, data):
        given = self._given(head["names"], *matrices)
        given = {**given, "response": matrices[0][0], "unknowns": {n: x[0] for n, x in given["unknowns"].items()}}
        by_response, by_unknowns = called(self.plugin.gradient, **given)
        by_unknowns = [float(by_unknowns[name]) for name in head["names"]]
        return None, [array(by_response, (matrices[0].shape[1],), "gradient"), [by_unknowns]], b""

    def _one(self, head, matrices):
        given = self._given(head["names"], *matrices)
        return {**given, "response": matrices[0][0], "unknowns": {n: float(x[0]) for n, x in given["unknowns"].items()}}

    def _parts(self, head, matrices):
        parts = called(self.plugin.variance, **self._one(head, matrices))
        parts = parts if isinstance(parts, dict) else {"discrepancy": parts}
        outputs = matrices[0].shape[1]
        full = {origin: np.broadcast_to(np.asarray(v, float), (outputs,)) for origin, v in parts.items()}
        known = {origin: (factor**2).sum(axis=1) for origin, factor in self.data.predictive}
        return {**known, **full}

    def predictive(self, head, matrices, data):
        parts = self._parts(head, matrices)
        return list(parts), [np.array(list(parts.values())).reshape(len(parts), -1)], b""

    def simulate(self, head, matrices, data):
        rng, shape = generator(head["key"]), self.data.values.shape
        if getattr(self.plugin, "simulate", None):
            values = called(self.plugin.simulate, rng=rng, **self._one(head, matrices))
        else:
            shared_by = dict(self.data.predictive)
            own = [v for origin, v in self._parts(head, matrices).items() if origin not in shared_by]
            shared = sum((f @ rng.standard_normal(f.shape[1]) for f in shared_by.values()), np.zeros(shape[1]))
            values = matrices[0] + shared + np.sqrt(sum(own)) * rng.standard_normal(shape)
        return None, [array(values, shape, "simulate")], b""


class Target:
    """The log density of a sampler, whose calls are counted."""

    def __init__(self, channel, dimension):
        self.dimension, self.evaluations, self._channel = dimension, 0, channel

    def log_density(self, points):
        """Log density at each row of `points`."""
        points = np.atleast_2d(points)
        self.evaluations += len(points)
        return self._channel.density("log_density", points)[0][0].copy()

    def log_prior(self, points):
        """Log density of the prior at each row of `points`."""
        return self._channel.density("log_prior", np.atleast_2d(points))[0][0].copy()

    def gradient(self, point):
        """Log density at a point, and its gradient."""
        self.evaluations += 1
        value, gradient = self._channel.density("gradient", np.atleast_2d(point))
        return float(value[0, 0]), gradient[0].copy()


class State:
    """The state of a sampler between two steps: `points` and `log_density` of the chains, `accepted`, and `memory`, a JSON value."""

    def __init__(self, points, log_density, accepted, memory):
        self.points, self.log_density = np.array(points), np.array(log_density)
        self.accepted, self.memory = np.array(accepted, dtype=bool), memory

    def message(self):
        rows = [self.points, self.log_density[None, :], self.accepted[None, :].astype(float)]
        return rows, self.memory


class SamplerServer(Server):
    NEEDED, OPTIONAL = ("step",), ("check", "finished", "harvest", "facts")

    def plan(self, head, matrices, data):
        if self._has("plan"):
            return called(self.plugin.plan, dimension=head["dimension"])
        get = lambda name, default: getattr(self.plugin, name, default)  # noqa: E731
        about = {"chains": get("walkers", get("chains", 4)), "steps": get("steps", 1000), "warm_up": get("warm_up", 0)}
        return {**about, "ensemble": bool(get("ensemble", self._has("walkers")))}

    def traits(self, head, matrices, data):
        names = ("uses_starts", "uses_gradient", "start_where", "steps_are_draws")
        return {name: getattr(self.plugin, name) for name in names if self._has(name)}

    def _state(self, head, matrices):
        points, log_density, accepted = matrices
        return State(points, log_density[0], accepted[0], head["memory"])

    def start(self, head, matrices, data):
        target = Target(self.channel, head["dimension"])
        points = np.array(matrices[0])
        state = State(points, target.log_density(points), np.zeros(len(points)), None)
        if self._has("start"):
            called(self.plugin.start, target=target, state=state)
        return self._told(state, target)

    def step(self, head, matrices, data):
        target, state = Target(self.channel, head["dimension"]), self._state(head, matrices)
        called(self.plugin.step, target=target, state=state, rng=generator(head["key"]))
        return self._told(state, target)

    def _told(self, state, target):
        rows, memory = state.message()
        return {"evaluations": target.evaluations, "memory": memory}, rows, b""

    def finished(self, head, matrices, data):
        return bool(called(self.plugin.finished, state=self._state(head, matrices)))

    def harvest(self, head, matrices, data):
        target, state = Target(self.channel, head["dimension"]), self._state(head, matrices)
        found = called(self.plugin.harvest, target=target, state=state, rng=generator(head["key"]))
        about = {name: found[name] for name in ("effective_size", "evidence", "doubts") if name in found}
        about.setdefault("effective_size", float(len(found["points"])))
        return about, [found["points"], np.asarray(found["log_density"])[None, :]], b""

    def facts(self, head, matrices, data):
        return [{"name": str(name), "value": str(value)} for name, value in called(self.plugin.facts).items()]


class Scaled:
    """A regressor in the manner of scikit-learn, with inputs and outputs of mean zero and variance one."""

    def __init__(self, regressor, inputs, outputs):
        self.regressor = regressor
        self.centre, self.scale = _moments(inputs)
        self.mean, self.spread = _moments(outputs)
        targets = (outputs - self.mean) / self.spread
        regressor.fit((inputs - self.centre) / self.scale, targets[:, 0] if targets.shape[1] == 1 else targets)

    def predict(self, inputs):
        found = np.asarray(self.regressor.predict((inputs - self.centre) / self.scale), dtype=float)
        return self.mean + self.spread * found.reshape(len(inputs), len(self.mean))


def _moments(rows):
    sd = rows.std(axis=0)
    return rows.mean(axis=0), np.where(sd > 0, sd, 1.0)


class SurrogateServer(Server):
    NEEDED, OPTIONAL = (), ("check",)
    FOLDS = 10

    @classmethod
    def has(cls, of):
        if not hasattr(of, "regressor") and not callable(getattr(of, "fit", None)):
            raise Wrong(f"the class `{of.__name__}` has no method `fit`")
        return super().has(of)

    def _fitted(self, head, inputs, outputs):
        rng = generator(head["key"])
        if not hasattr(self.plugin, "regressor"):
            about = {"parameters": head["parameters"], "layouts": [Layout(each) for each in head["layouts"]]}
            return called(self.plugin.fit, inputs=inputs, outputs=outputs, rng=rng, **about)
        chosen = {name: getattr(self.plugin, name) for name in plugin.options(type(self.plugin))}
        if "random_state" in inspect.signature(self.plugin.regressor).parameters:
            chosen["random_state"] = int(rng.integers(2**31))
        return Scaled(self.plugin.regressor(**chosen), inputs, outputs)

    def fit(self, head, matrices, data):
        inputs, outputs = (np.array(matrix) for matrix in matrices)
        emulator = self._fitted(head, inputs, outputs)
        residuals = self._residuals(head, inputs, outputs)
        variance = outputs.var(axis=0)
        relative = (residuals**2).mean(axis=0) / np.where(variance > 0, variance, 1.0)
        return None, [relative[None, :], residuals], pickle.dumps(emulator)

    def _residuals(self, head, inputs, outputs):
        """Residuals of runs that were left out: one fold of ten at a time."""
        residuals, folds = np.empty_like(outputs), np.arange(len(inputs)) % min(self.FOLDS, len(inputs))
        for fold in np.unique(folds):
            out = folds == fold
            emulator = self._fitted(head, inputs[~out], outputs[~out])
            residuals[out] = outputs[out] - EmulatorServer(emulator, outputs.shape[1]).both(inputs[out])[0]
        return residuals

    def load(self, head, matrices, data):
        served = EmulatorServer(pickle.loads(data), head["outputs"])
        return Made(served, {"has": served.has(np.array(head["point"])[None, :])})


class EmulatorServer:
    # Step of the central differences, as a part of the range over which the parameter varies.
    STEP = 1e-4

    def __init__(self, emulator, outputs):
        self.emulator, self.outputs = emulator, outputs

    def both(self, points):
        """Mean and, where the emulator knows it, standard deviation at each point."""
        found = called(self.emulator.predict, inputs=points)
        mean, sd = found if isinstance(found, tuple) else (found, None)
        shape = (len(points), self.outputs)
        return array(mean, shape, "predict"), None if sd is None else array(sd, shape, "predict")

    def has(self, points):
        return ["variance"] if self.both(points)[1] is not None else []

    def mean(self, head, matrices, data):
        return None, [self.both(matrices[0])[0]], b""

    def variance(self, head, matrices, data):
        return None, [self.both(matrices[0])[1] ** 2], b""

    def jacobian(self, head, matrices, data):
        point = matrices[0][0]
        if getattr(self.emulator, "jacobian", None):
            slopes = called(self.emulator.jacobian, point=point)
            return None, [array(slopes, (self.outputs, len(point)), "jacobian")], b""
        steps = self.STEP * np.array(head["ranges"])
        beside = np.vstack([point + np.diag(steps), point - np.diag(steps)])
        values = self.both(beside)[0]
        half = len(point)
        return None, [((values[:half] - values[half:]) / (2 * steps[:, None])).T], b""


class ReaderServer(Server):
    NEEDED, OPTIONAL = (), ("check", "measurements", "runs", "files", "grid")

    def files(self, head, matrices, data):
        if self._has("files"):
            return [str(path) for path in called(self.plugin.files, scenario=head["scenario"])]
        found = [getattr(self.plugin, name, None) for name in ("path", "file", "paths")]
        flat = [each for value in found if value for each in (value if isinstance(value, list) else [value])]
        return [str(path) for path in flat]

    def measurements(self, head, matrices, data):
        layout = Layout(head["layout"])
        found = called(self.plugin.measurements, folder=head["directory"], layout=layout, scenario=head["scenario"])
        if not isinstance(found, dict):
            rows = np.asarray(found, dtype=float).reshape(-1, layout.size)
            found = {str(k + 1): row for k, row in enumerate(rows)}
        rows = [array(values, layout.shape, "measurements").reshape(-1) for values in found.values()]
        return [str(name) for name in found], [np.array(rows).reshape(len(rows), layout.size)], b""

    def runs(self, head, matrices, data):
        layout, names = Layout(head["layout"]), head["parameters"]
        given = {"folder": head["directory"], "layout": layout, "scenario": head["scenario"], "parameters": names}
        points, responses = called(self.plugin.runs, **given)
        if isinstance(points, dict):
            points = np.column_stack([np.asarray(points[name], dtype=float) for name in names])
        points = np.atleast_2d(np.asarray(points, dtype=float))
        return None, [array(points, (len(points), len(names)), "runs"), array(responses, (len(points), layout.size), "runs")], b""

    def grid(self, head, matrices, data):
        given = {"folder": head["directory"], "axis": head["axis"], "unit": head["unit"], "scenario": head["scenario"]}
        values = np.asarray(called(self.plugin.grid, **given), dtype=float)
        return None, [values.reshape(1, -1)], b""


SERVERS = {
    "model": ModelServer,
    "quantity": QuantityServer,
    "effect": EffectServer,
    "discrepancy": DiscrepancyServer,
    "sampler": SamplerServer,
    "surrogate": SurrogateServer,
    "reader": ReaderServer,
}
