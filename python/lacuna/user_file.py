"""What all workers do with a file of the user: its descriptors, its execution, its errors.

Messages use descriptors of their own, so that whatever the user's code prints or reads cannot disturb them: its standard
output is redirected to its standard error. No package is needed, and Python 3.8 suffices.
"""

import importlib.util
import os
import sys
import traceback


def streams():
    """Descriptors of the requests and of the answers."""
    requests = os.fdopen(os.dup(0), "rb")
    answers = os.fdopen(os.dup(1), "wb")
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.close(nothing)
    os.dup2(2, 1)
    return requests, answers


def load(path):
    """Runs the user's file as a module."""
    sys.path.insert(0, os.path.dirname(path))
    sys.argv = [path]
    name = os.path.splitext(os.path.basename(path))[0]
    spec = importlib.util.spec_from_file_location(name, path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    # Not by the loader: its compiled copy may be that of an earlier text of the same second and length.
    with open(path, "rb") as file:
        text = file.read()
    exec(compile(text, path, "exec"), module.__dict__)
    return module


def explain(error, path):
    """Describes the error and the last line of the user's file in its traceback."""
    said = str(error)
    return type(error).__name__ + (f": {said}" if said else "") + line_of(error, path)


def line_of(error, path):
    """The last line of the user's file in the traceback of an error, in words."""
    frames = [f for f in traceback.extract_tb(error.__traceback__) if f.filename == path]
    if not frames:
        return ""
    line = f": `{frames[-1].line}`" if frames[-1].line else ""
    return f", in line {frames[-1].lineno}{line}"
