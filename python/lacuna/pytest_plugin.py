"""A pytest plugin: the contract of each plugin in a Python file is a test.

``pytest --lacuna-plugins mine.py``, or in the configuration of pytest ``lacuna_plugins = mine.py`` (several files in
several lines) and options for them ``lacuna_options = discrepancy.noise.scale=0.1``.
"""

import subprocess
import sys
from pathlib import Path

import pytest

from . import plugin, user_file


def pytest_addoption(parser):
    group = parser.getgroup("lacuna")
    group.addoption("--lacuna-plugins", action="append", default=[], metavar="FILE", help="test the Lacuna plugins of FILE")
    parser.addini("lacuna_plugins", "Python files of Lacuna plugins", type="linelist")
    parser.addini("lacuna_options", "options of these plugins: KIND.NAME.KEY=VALUE", type="linelist")


def pytest_collect_file(file_path, parent):
    config = parent.config
    named = [*config.getoption("--lacuna-plugins"), *config.getini("lacuna_plugins")]
    if any((config.rootpath / name).resolve() == file_path.resolve() for name in named):
        return PluginFile.from_parent(parent, path=file_path)
    return None


def pytest_configure(config):
    # Files that the command line names are collected, whether or not their names look like tests.
    named = [str((config.rootpath / name).resolve()) for name in config.getoption("--lacuna-plugins")]
    config.args = [*(arg for arg in config.args if not named or arg != str(config.invocation_params.dir)), *named]


class PluginFile(pytest.File):
    """A file of plugins."""

    def collect(self):
        before = dict(plugin.PLUGINS)
        plugin.PLUGINS.clear()
        try:
            user_file.load(str(self.path))
            names = [f"{kind}.{name}" for kind, name in plugin.PLUGINS]
        finally:
            plugin.PLUGINS.clear()
            plugin.PLUGINS.update(before)
        for name in names:
            yield Contract.from_parent(self, name=name)


class Broken(Exception):
    """A plugin that breaks the contract of its kind."""


class Contract(pytest.Item):
    """The contract of one plugin."""

    def runtest(self):
        options = [text for text in self.config.getini("lacuna_options") if text.startswith(f"{self.name}.")]
        command = [sys.executable, "-m", "lacuna", "plugins", "test", str(self.path), "--only", self.name]
        command += [word for text in options for word in ("--set", text)]
        ended = subprocess.run(command, capture_output=True, text=True, cwd=Path.cwd(), check=False)
        if ended.returncode != 0:
            raise Broken((ended.stdout + ended.stderr).strip())

    def repr_failure(self, excinfo, style=None):
        if isinstance(excinfo.value, Broken):
            return str(excinfo.value)
        return super().repr_failure(excinfo, style)

    def reportinfo(self):
        return self.path, None, self.name
