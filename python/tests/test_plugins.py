"""Plugins in Python, from the wheel."""

import subprocess
import sys
import textwrap

import numpy as np
import pytest

import lacuna
from lacuna import plugin

WALK = textwrap.dedent(
    '''
    import lacuna
    import numpy as np

    @lacuna.sampler
    class Walk:
        """Random walk."""

        chains: int = lacuna.option(8, "Chains.", minimum=2)
        steps: int = 4000
        size: float = lacuna.option(0.2, "Step.", above=0)

        def step(self, target, state, rng):
            points = state.points + self.size * rng.standard_normal(state.points.shape)
            density = target.log_density(points)
            moves = np.log(rng.uniform(size=len(points))) < density - state.log_density
            state.points[moves], state.log_density[moves] = points[moves], density[moves]
            state.accepted[:] = moves
    '''
)


@pytest.fixture
def walk(tmp_path):
    file = tmp_path / "walk.py"
    file.write_text(WALK)
    return file


def test_a_sampler_in_python_finds_the_closed_form(study, walk, line, tmp_path):
    from test_lacuna import closed_form

    ours = {**study, "plugins": {"python": walk}, "sampler": {"use": "walk"}}
    run = lacuna.run(ours, out=tmp_path / "run", progress=False)
    mean, covariance = closed_form(line[1])
    for name, expected, variance in zip(["level0", "rise"], mean, np.diag(covariance)):
        found = run.summary["parameters"][name]
        # Four Monte Carlo errors, as the run states them.
        assert abs(found["mean"] - expected) < 4 * found["mcse_mean"]
        assert found["sd"] == pytest.approx(np.sqrt(variance), rel=0.1)


def test_a_wrong_option_is_told_with_its_key(study, walk):
    ours = {**study, "plugins": {"python": walk}, "sampler": {"use": "walk", "size": -1.0}}
    with pytest.raises(lacuna.StudyError) as caught:
        lacuna.run(ours, progress=False)
    assert "wrong value for `size`" in str(caught.value) and "above 0" in str(caught.value)


QUANTITY = "import lacuna\n\n@lacuna.quantity\nclass {}:\n    def value(self, curve):\n        return {}\n"


def test_pytest_runs_the_contracts(tmp_path):
    (tmp_path / "largest.py").write_text(QUANTITY.format("Largest", "curve.max()"))
    # An undefined curve has no value, which this one does not know.
    (tmp_path / "one.py").write_text(QUANTITY.format("One", "1.0"))
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider"]
    command += ["--lacuna-plugins", "largest.py", "--lacuna-plugins", "one.py"]
    ended = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, check=False)
    assert "1 failed, 1 passed" in ended.stdout, ended.stdout + ended.stderr
    assert "quantity.one  BREAKS its contract" in ended.stdout


def test_options_have_a_schema():
    class Sized:
        """A size."""

        size: float = plugin.option(0.5, "The size.", above=0)
        names: list[str] = plugin.option()
        most: int | None = None

    assert plugin.schema(Sized) == {
        "type": "object",
        "properties": {
            "size": {"type": "number", "exclusiveMinimum": 0, "description": "The size.", "default": 0.5},
            "names": {"type": "array", "items": {"type": "string"}},
            "most": {"type": "integer"},
        },
        "additionalProperties": False,
        "required": ["names"],
        "description": "A size.",
    }
    with pytest.raises(plugin.Complaint) as caught:
        plugin.build(Sized, {"size": 0, "most": 1.5})
    assert [fault["at"] for fault in caught.value.faults] == ["size", "", "most"]
    sound = plugin.build(Sized, {"names": ["a"], "size": {"float": "inf"}})
    assert (sound.size, sound.names, sound.most) == (float("inf"), ["a"], None)
    assert plugin.written(sound) == {"size": {"float": "inf"}, "names": ["a"]}
