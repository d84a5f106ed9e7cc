"""Serves the plugins of one file to the program.

A message is a line of JSON, then the numbers of its matrices (doubles in little-endian order), then its bytes:
``{"head": ..., "matrices": [[rows, columns], ...], "bytes": n}``.
"""

import json

import numpy as np

from . import plugin, serve, user_file


class Channel:
    """Messages to and from the program."""

    def __init__(self):
        self.requests, self.answers = user_file.streams()

    def read(self):
        """The next message: its head, matrices and bytes; `None` at the end."""
        line = self.requests.readline()
        if not line:
            return None
        about = json.loads(line)
        matrices = []
        for rows, columns in about["matrices"]:
            numbers = np.frombuffer(self._exactly(8 * rows * columns), dtype="<f8")
            matrices.append(numbers.reshape(rows, columns))
        return about["head"], matrices, self._exactly(about["bytes"])

    def _exactly(self, count):
        data = self.requests.read(count) if count else b""
        if len(data) != count:
            raise EOFError("the program has ended")
        return data

    def write(self, head, matrices=(), data=b""):
        """Sends a message."""
        matrices = [np.ascontiguousarray(np.atleast_2d(np.asarray(m, dtype="<f8"))) for m in matrices]
        about = {"head": head, "matrices": [m.shape for m in matrices], "bytes": len(data)}
        self.answers.write(json.dumps(about).encode() + b"\n")
        for matrix in matrices:
            self.answers.write(matrix.tobytes())
        self.answers.write(data)
        self.answers.flush()

    def density(self, what, points):
        """Asks the program for the log density that a sampler draws from; returns its matrices."""
        self.write({"ask": what}, [points])
        heard = self.read()
        if heard is None:
            raise EOFError("the program has ended")
        head, matrices, _ = heard
        if "error" in head:
            raise RuntimeError(head["error"])
        return matrices


def explained(error, path):
    """The error, and the last line of the user's file in its traceback."""
    if isinstance(error, SyntaxError) and error.filename == path:
        return f"{error.msg}, in line {error.lineno}"
    if isinstance(error, serve.Wrong):
        return f"{error}{user_file.line_of(error, path)}"
    return user_file.explain(error, path)


def answered(channel, objects, head, matrices, data):
    """Does what a message asks; returns head, matrices and bytes of the answer."""
    for old in head.get("forget", ()):
        objects.pop(old, None)
    do = head["do"]
    if do == "new":
        made = plugin.build(plugin.PLUGINS[head["kind"], head["name"]], head["options"])
        objects[head["id"]] = serve.SERVERS[head["kind"]](made, channel)
        return {"options": plugin.written(made)}, [], b""
    if do == "know":
        objects[head["makes"]] = serve.known(head["about"])
        return {}, [], b""
    server, head = objects[head["id"]], {**objects.get(head.get("known"), {}), **head}
    result = getattr(server, do)(head, matrices, data)
    answer, matrices, data = result if isinstance(result, tuple) else (result, [], b"")
    if isinstance(answer, serve.Made):
        objects[head["makes"]] = answer.server
        answer = answer.about
    return {"answer": answer}, matrices, data


def refusal(error, path):
    """The head of the answer to a request that failed."""
    if isinstance(error, plugin.Complaint):
        return {"complaints": error.faults}
    kind = "rejected" if isinstance(error, plugin.Rejected) else "error"
    return {kind: explained(error, path)}


def main(path):
    """Loads the file, declares its plugins, and answers until the program ends."""
    channel, objects = Channel(), {}
    try:
        user_file.load(path)
        channel.write({"plugins": [
            {"kind": kind, "name": name, "schema": plugin.schema(cls), "has": serve.SERVERS[kind].has(cls)}
            for (kind, name), cls in plugin.PLUGINS.items()
        ]})
    except BaseException as error:  # Whatever the file raises is told, also `SystemExit`.
        channel.write({"error": explained(error, path)})
        return
    while (message := channel.read()) is not None:
        try:
            channel.write(*answered(channel, objects, *message))
        except EOFError:
            return
        except Exception as error:
            channel.write(refusal(error, path))
