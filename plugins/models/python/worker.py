# Calls the functions of a user's file, with `streams`, `load` and `explain` of `user_file`, whose text stands before this one.
#
# A request is one line of JSON on standard input; an answer is one line of JSON and, after `{"count": n}`, n doubles in
# little-endian order.
import array
import collections.abc
import contextlib
import inspect
import json
import sys


class Wrong(Exception):
    """A result that is not a valid response."""


def grouped(names):
    """Place of each argument among the inputs; of a field, whose values are `name[1]` and so on, a list of places."""
    groups = {}
    for place, name in enumerate(names):
        base, bracket, _ = name.partition("[")
        if bracket:
            groups.setdefault(base, []).append(place)
        else:
            groups[name] = place
    return groups


class Function:
    """A function of the user's file and the arguments that it receives."""

    def __init__(self, module, name, names):
        self.name = name
        self.call = getattr(module, name, None)
        if not callable(self.call):
            raise Wrong(f"there is no function `{name}`")
        try:
            parameters = inspect.signature(self.call).parameters
        except (TypeError, ValueError):
            parameters = {}
        kinds = inspect.Parameter
        takes_all = not parameters or any(p.kind is kinds.VAR_KEYWORD for p in parameters.values())
        by_name = {
            n: p
            for n, p in parameters.items()
            if p.kind in (kinds.POSITIONAL_OR_KEYWORD, kinds.KEYWORD_ONLY)
        }
        extra = ["layout", "scenario"]
        self.extra = [n for n in extra if n in by_name and n not in names]
        if not takes_all:
            for n in names:
                if n not in by_name:
                    raise Wrong(f"`{name}` has no argument for the input `{n}`")
        for n, p in by_name.items():
            if p.default is kinds.empty and n not in names and n not in self.extra:
                raise Wrong(f"`{name}` requires the argument `{n}`, which is not an input of the study")


def is_one(value):
    return not isinstance(value, (str, bytes, collections.abc.Mapping)) and not hasattr(value, "__len__")


def number(value):
    if isinstance(value, (str, bytes)):
        raise Wrong(f"expected a number, found {value!r:.60}")
    try:
        return float(value)
    except (TypeError, ValueError):
        raise Wrong(f"expected a number, found {value!r:.60}") from None


def listed(value, what):
    if isinstance(value, (str, bytes)) or not isinstance(value, collections.abc.Iterable):
        raise Wrong(f"expected {what}, found {value!r:.60}")
    return list(value)


def size(axes):
    product = 1
    for axis in axes:
        product *= axis["length"]
    return product


def place(value, axes, into):
    """Appends the values of a nested result in row-major order."""
    if not axes:
        into.append(number(value))
        return
    axis, inner = axes[0], axes[1:]
    name, labels = axis["name"], axis.get("labels")
    if isinstance(value, collections.abc.Mapping):
        if labels is None:
            raise Wrong(f"expected a list along `{name}`, found a dict")
        for key in value:
            if key not in labels:
                raise Wrong(f"the response has no {name} `{key}`")
        for label in labels:
            if label not in value:
                raise Wrong(f"no values of {name} `{label}`")
        items = [value[label] for label in labels]
    else:
        items = listed(value, f"values along `{name}`")
    if len(items) != axis["length"]:
        raise Wrong(f"{len(items)} values along `{name}`, expected {axis['length']}")
    if not inner and extended(into, items):
        return
    for item in items:
        place(item, inner, into)


def extended(into, items):
    """Appends all items; returns false if one of them is not a number."""
    try:
        into.extend(array.array("d", items))
    except TypeError:
        return False
    return True


def flatten(value, axes):
    """Converts a result to doubles: an array, nested lists, one flat list, or dicts by label."""
    shape, count = tuple(axis["length"] for axis in axes), size(axes)
    numpy = sys.modules.get("numpy")
    if numpy is not None and isinstance(value, numpy.ndarray) and value.dtype.kind in "fiub":
        if value.shape == shape or value.shape == (count,):
            return numpy.ascontiguousarray(value, dtype="<f8").tobytes()
        raise Wrong(f"the response has the shape {value.shape}, expected {shape}")
    into = array.array("d")
    if not isinstance(value, (str, bytes, collections.abc.Mapping)) and isinstance(
        value, collections.abc.Iterable
    ):
        value = list(value)
        if len(axes) != 1 and all(is_one(item) for item in value):
            if len(value) != count:
                raise Wrong(f"the response has {len(value)} values, expected {count}")
            if not extended(into, value):
                into.extend(number(item) for item in value)
            return little_endian(into)
    place(value, axes, into)
    return little_endian(into)


def little_endian(values):
    if sys.byteorder == "big":
        values.byteswap()
    return values.tobytes()


def columns(value, axes, groups, count):
    """Derivatives with one row per value of the response and one column per input."""
    if not isinstance(value, collections.abc.Mapping):
        return flatten(value, axes + [{"name": "input", "length": count}])
    parts = [None] * count
    for name, places in groups.items():
        if name not in value:
            raise Wrong(f"no derivatives by `{name}`")
        inner = [] if isinstance(places, int) else [{"name": name, "length": len(places)}]
        part = array.array("d", flatten(value[name], axes + inner))
        if sys.byteorder == "big":
            part.byteswap()
        own = places if inner else [places]
        for k, place in enumerate(own):
            parts[place] = part[k :: len(own)]
    return little_endian(array.array("d", (x for row in zip(*parts) for x in row)))


def together(values, places):
    """The values of a field: its places along the last axis."""
    numpy = sys.modules.get("numpy")
    own = [values[place] for place in places]
    if numpy is not None:
        return numpy.stack(own, axis=-1)
    return [list(one) for one in zip(*own)] if isinstance(own[0], list) else own


class Worker:
    def __init__(self, path, simulate, gradient, vectorised):
        self.path, self.vectorised = path, vectorised
        self.module = load(path)
        self.names, self.groups, self.axes, self.extra = [], {}, [], {}
        self.wanted = {"simulate": simulate, "gradient": gradient}
        self.functions = {}

    def prepare(self, request):
        """Stores the data that do not change from call to call."""
        self.names = request["names"]
        self.groups = grouped(self.names)
        layout = request["layout"]
        self.axes = [
            {"name": a["name"], "labels": a.get("labels"), "length": len(a.get("labels") or a["values"])}
            for a in layout["axes"]
        ]
        self.extra = {"layout": layout, "scenario": request["scenario"]}
        self.functions = {
            key: Function(self.module, name, self.groups) for key, name in self.wanted.items() if name
        }

    def arguments(self, function, values):
        arguments = {}
        for name, places in self.groups.items():
            arguments[name] = values[places] if isinstance(places, int) else together(values, places)
        arguments.update((name, self.extra[name]) for name in function.extra)
        return arguments

    def simulate(self, rows):
        function = self.functions["simulate"]
        if not self.vectorised:
            return b"".join(
                flatten(function.call(**self.arguments(function, row)), self.axes) for row in rows
            )
        inputs = [list(column) for column in zip(*rows)]
        numpy = sys.modules.get("numpy")
        if numpy is not None:
            inputs = [numpy.array(column) for column in inputs]
        answer = function.call(**self.arguments(function, inputs))
        if numpy is not None and isinstance(answer, numpy.ndarray):
            wanted = (len(rows), *(axis["length"] for axis in self.axes))
            if answer.shape not in (wanted, (len(rows), size(self.axes))):
                raise Wrong(f"the responses have the shape {answer.shape}, expected {wanted}")
        if isinstance(answer, collections.abc.Mapping):
            raise Wrong("expected one response a run, found a dict")
        answer = listed(answer, "one response a run")
        if len(answer) != len(rows):
            raise Wrong(f"{len(answer)} responses of {len(rows)} runs")
        return b"".join(flatten(one, self.axes) for one in answer)

    def gradient(self, rows):
        function = self.functions["gradient"]
        return b"".join(
            columns(
                function.call(**self.arguments(function, row)), self.axes, self.groups, len(self.names)
            )
            for row in rows
        )

    def answer(self, request):
        if "names" in request:
            self.prepare(request)
            return b""
        return {"simulate": self.simulate, "gradient": self.gradient}[request["call"]](request["rows"])


def main():
    requests, answers = streams()

    def say(answer, data=b""):
        answers.write(json.dumps(answer).encode() + b"\n" + data)
        answers.flush()

    path, simulate, gradient, vectorised = sys.argv[1:5]
    try:
        worker = Worker(path, simulate, gradient, vectorised == "vectorised")
    except (Exception, SystemExit) as error:
        say({"error": explain(error, path)})
        return
    say({"count": 0})
    for line in requests:
        try:
            data = worker.answer(json.loads(line))
        except Wrong as error:
            say({"error": str(error)})
        except (Exception, SystemExit) as error:
            say({"error": explain(error, path)})
        else:
            say({"count": len(data) // 8}, data)
        # The output is for messages only; the user's code may have closed or replaced the stream.
        with contextlib.suppress(Exception):
            sys.stdout.flush()


main()
