"""Writes the definitions of a Python file, without running it, as one line of JSON to standard output."""
import ast
import json
import sys


def described(function):
    """The arguments of a function that can be given by name."""
    arguments = function.args
    named = [a.arg for a in arguments.args + arguments.kwonlyargs]
    optional = [a.arg for a in arguments.args[len(arguments.args) - len(arguments.defaults):]]
    optional += [a.arg for a, default in zip(arguments.kwonlyargs, arguments.kw_defaults) if default]
    return {"names": named, "optional": optional, "any": arguments.kwarg is not None}


def main():
    path, names = sys.argv[1], sys.argv[2:]
    with open(path, "rb") as file:
        text = file.read()
    try:
        module = ast.parse(text, filename=path)
    except (SyntaxError, ValueError) as error:
        where = getattr(error, "lineno", None)
        print(json.dumps({"error": getattr(error, "msg", None) or str(error), "line": where}))
        return
    found = {}
    for node in module.body:
        if isinstance(node, ast.FunctionDef) and node.name in names:
            # A decorator may change the arguments of a function.
            found[node.name] = None if node.decorator_list else described(node)
    other = {node.id for node in ast.walk(module) if isinstance(node, ast.Name)}
    for node in ast.walk(module):
        if isinstance(node, (ast.Import, ast.ImportFrom)):
            other.update(alias.asname or alias.name for alias in node.names)
        elif isinstance(node, (ast.FunctionDef, ast.ClassDef)):
            other.add(node.name)
    defined = [n.name for n in module.body if isinstance(n, ast.FunctionDef)]
    unknown = [name for name in names if name not in found and name not in other and "*" not in other]
    print(json.dumps({"functions": found, "unknown": unknown, "defined": defined}))


main()
