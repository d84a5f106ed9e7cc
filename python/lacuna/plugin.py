"""Plugins in Python: classes that studies select by name.

    import lacuna

    @lacuna.quantity
    class Overshoot:
        \"\"\"Largest value above a level.\"\"\"

        level: float = lacuna.option(0.0, "Level, in the unit of the response.")

        def value(self, curve, grid):
            return max(curve.max() - self.level, 0.0)

A study loads the file with ``[plugins] python = "mine.py"`` and selects ``overshoot``. The class's docstring is the
manual of the plugin, its annotated attributes are its options. ``docs/python_plugins.md`` tells the methods of each
kind.
"""

import inspect
import re
import types
import typing

KINDS = ("model", "quantity", "effect", "discrepancy", "sampler", "surrogate", "reader")

__all__ = [*KINDS, "option", "unknown", "fault", "Complaint", "Rejected"]

# Kind and name of each plugin of the process, and its class.
PLUGINS = {}

_REQUIRED = object()
_SCALARS = {float: "number", int: "integer", bool: "boolean", str: "string"}


class Option:
    """An option of a plugin: its default, its meaning, and the values that it may have."""

    def __init__(self, default=_REQUIRED, doc="", minimum=None, maximum=None, above=None, choices=None):
        self.default, self.doc, self.choices = default, doc, choices
        self.minimum, self.maximum, self.above = minimum, maximum, above

    def limits(self):
        """The limits of the value as words of a JSON Schema."""
        words = {"minimum": self.minimum, "maximum": self.maximum, "exclusiveMinimum": self.above, "enum": self.choices}
        return {word: limit for word, limit in words.items() if limit is not None}


def option(default=_REQUIRED, doc="", *, minimum=None, maximum=None, above=None, choices=None):
    """An option with a meaning and limits; one without a default must be given by the study."""
    return Option(default, doc, minimum, maximum, above, choices)


class Complaint(Exception):
    """Options that are wrong: each fault with the key of the option."""

    def __init__(self, *faults):
        super().__init__("; ".join(fault["message"] for fault in faults))
        self.faults = list(faults)


def fault(at, message, expected=None, found=None):
    """A fault of the option with this key, for `Complaint`."""
    texts = {"at": at, "message": message, "expected": expected, "found": found}
    return {key: str(text) for key, text in texts.items() if text is not None}


class Rejected(Exception):
    """Raised by a model that has no answer for these inputs but may have one for others."""


def _decorator(kind):
    def named(target, name):
        cls = _wrapped(target) if kind == "surrogate" and hasattr(target, "predict") else target
        name = name or _snake(getattr(target, "__name__", ""))
        if not re.fullmatch(r"[a-z][a-z0-9_]*", name):
            raise ValueError(f"`{name}` is no name for a plugin: expected small letters, digits and `_`")
        if (kind, name) in PLUGINS:
            raise ValueError(f"there are two plugins `{kind}.{name}`")
        PLUGINS[kind, name] = cls
        return target

    def decorate(target=None, name=None):
        if isinstance(target, str):
            target, name = None, target
        return (lambda cls: named(cls, name)) if target is None else named(target, name)

    decorate.__name__ = kind
    decorate.__doc__ = f"Makes a class a {kind}; its name in studies is `name`, or that of the class in small letters."
    return decorate


model = _decorator("model")
quantity = _decorator("quantity")
effect = _decorator("effect")
discrepancy = _decorator("discrepancy")
sampler = _decorator("sampler")
surrogate = _decorator("surrogate")
reader = _decorator("reader")


def _snake(name):
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", "_", name).lower()


def options(cls):
    """The options of a class with the type of each, in the order in which they are written."""
    found = {}
    for base in reversed(cls.__mro__):
        hints = inspect.get_annotations(base, eval_str=True) if base is not object else {}
        for name, hint in hints.items():
            if name.startswith("_") or typing.get_origin(hint) is typing.ClassVar:
                continue
            given = cls.__dict__.get(name, getattr(cls, name, _REQUIRED))
            found[name] = (hint, given if isinstance(given, Option) else Option(given))
    return found


def schema(cls):
    """JSON Schema of the options of a class."""
    properties, required = {}, []
    for name, (hint, about) in options(cls).items():
        properties[name] = {**_schema_of(hint), **about.limits()}
        if about.doc:
            properties[name]["description"] = about.doc
        if about.default is _REQUIRED:
            required.append(name)
        elif about.default is not None:
            properties[name]["default"] = about.default
    described = {"type": "object", "properties": properties, "additionalProperties": False}
    if required:
        described["required"] = required
    doc = inspect.getdoc(cls)
    return {**described, "description": doc} if doc else described


def _schema_of(hint):
    hint, _ = _optional(hint)
    origin, inner = typing.get_origin(hint), typing.get_args(hint)
    if hint in _SCALARS:
        return {"type": _SCALARS[hint]}
    if origin in (list, tuple) or hint in (list, tuple):
        return {"type": "array", "items": _schema_of(inner[0]) if inner else {}}
    if origin is dict or hint is dict:
        return {"type": "object"}
    if hint in (typing.Any, object):
        return {}
    raise TypeError(f"an option cannot have the type {hint}: expected float, int, bool, str, list[...] or dict")


def _optional(hint):
    """The type without `None`, and whether `None` is allowed."""
    if typing.get_origin(hint) in (typing.Union, types.UnionType):
        parts = [part for part in typing.get_args(hint) if part is not type(None)]
        if len(parts) == 1:
            return parts[0], True
    return hint, False


def build(cls, given):
    """A plugin with these options; `Complaint` names those that are wrong."""
    plugin, faults = cls.__new__(cls), []
    for name, (hint, about) in options(cls).items():
        value = given.get(name, about.default)
        if value is _REQUIRED:
            faults.append(fault("", f"missing key `{name}`"))
            continue
        value = _decoded(value)
        if name in given:
            try:
                value = _converted(value, hint)
                _within(value, about)
            except ValueError as wrong:
                faults.append(fault(name, f"wrong value for `{name}`", str(wrong), _shown(given[name])))
                continue
        object.__setattr__(plugin, name, value)
    if faults:
        raise Complaint(*faults)
    if cls.__init__ is not object.__init__:
        cls.__init__(plugin)
    return plugin


def written(plugin):
    """All options of a plugin with their values."""
    values = {name: getattr(plugin, name) for name in options(type(plugin))}
    return {name: _encoded(value) for name, value in values.items() if value is not None}


def _converted(value, hint):
    hint, may_be_none = _optional(hint)
    if value is None and may_be_none:
        return None
    origin, inner = typing.get_origin(hint), typing.get_args(hint)
    if hint is float and isinstance(value, (int, float)) and not isinstance(value, bool):
        return float(value)
    if hint is int and isinstance(value, int) and not isinstance(value, bool):
        return value
    if hint in (bool, str) and isinstance(value, hint):
        return value
    if origin in (list, tuple) or hint in (list, tuple):
        if isinstance(value, list):
            return [_converted(each, inner[0]) for each in value] if inner else value
        raise ValueError("an array")
    if (origin is dict or hint is dict) and isinstance(value, dict):
        return value
    if hint in (typing.Any, object):
        return value
    names = {float: "a number", int: "a whole number", bool: "`true` or `false`", str: "a text", dict: "a table"}
    raise ValueError(names.get(origin or hint, f"a value of the type {hint}"))


def _within(value, about):
    for each in value if isinstance(value, list) else [value]:
        if about.choices is not None and each not in about.choices:
            raise ValueError("one of " + ", ".join(f"`{choice}`" for choice in about.choices))
        if about.minimum is not None and not each >= about.minimum:
            raise ValueError(f"{about.minimum} or more")
        if about.maximum is not None and not each <= about.maximum:
            raise ValueError(f"{about.maximum} or less")
        if about.above is not None and not each > about.above:
            raise ValueError(f"a number above {about.above}")


def _shown(value):
    return f"`{value}`" if isinstance(value, str) else value


def _decoded(value):
    """Numbers that are not finite are written `{"float": "inf"}` in JSON."""
    if isinstance(value, dict):
        if list(value) == ["float"]:
            return float(value["float"])
        return {key: _decoded(each) for key, each in value.items()}
    return [_decoded(each) for each in value] if isinstance(value, list) else value


def _encoded(value):
    if isinstance(value, float) and (value != value or value in (float("inf"), float("-inf"))):
        return {"float": str(value)}
    if isinstance(value, dict):
        return {key: _encoded(each) for key, each in value.items()}
    return [_encoded(each) for each in value] if isinstance(value, (list, tuple)) else value


def _wrapped(regressor):
    """The plugin of a regressor in the manner of scikit-learn: its options are the simple arguments of its constructor."""
    annotations, defaults = {}, {}
    for argument in inspect.signature(regressor).parameters.values():
        default = argument.default
        if argument.name == "random_state" or argument.kind in (argument.VAR_POSITIONAL, argument.VAR_KEYWORD):
            continue
        if default is None:
            annotations[argument.name], defaults[argument.name] = typing.Any, None
        elif type(default) in _SCALARS:
            annotations[argument.name] = typing.Any if isinstance(default, (float, int)) else type(default)
            defaults[argument.name] = default
    doc = (inspect.getdoc(regressor) or regressor.__name__).split("\n\n")[0]
    body = {"__doc__": doc, "__annotations__": annotations, "regressor": regressor, **defaults}
    return type(regressor.__name__, (), body)


def unknown(name, prior, *, unit="1", symbol=None, log=False, start=None):
    """An unknown of a discrepancy or an effect.

    `prior` is written as in a study: ``{"half_normal": 0.1}``. With `log` its logarithm is sampled. Fits start at `start`, or
    else at the median of the prior.
    """
    about = {"name": name, "prior": prior, "unit": unit, "symbol": symbol or name, "log": log, "start": start}
    return {key: value for key, value in about.items() if value is not None}
