"""Runs, results and emulators against the closed form of a straight line."""

import subprocess
import sys

import numpy as np
import pytest

import lacuna

from conftest import NOISE, PRIOR, TIMES


def closed_form(data):
    """Mean and covariance of level and rise: conjugate normal distributions."""
    design = np.column_stack([np.ones_like(TIMES), TIMES])
    precision = np.diag(PRIOR**-2) + len(data) * design.T @ design / NOISE**2
    covariance = np.linalg.inv(precision)
    return covariance @ design.T @ data.sum(axis=0) / NOISE**2, covariance


def test_the_posterior_is_that_of_the_closed_form(finished, line):
    run, _ = finished
    mean, covariance = closed_form(line[1])
    for name, expected, variance in zip(["level0", "rise"], mean, np.diag(covariance)):
        found = run.summary["parameters"][name]
        # Four Monte Carlo errors, as the run states them.
        assert abs(found["mean"] - expected) < 4 * found["mcse_mean"]
        assert abs(run.posterior.mean()[name] - found["mean"]) < 1e-9
        assert run.posterior.sd()[name] == pytest.approx(np.sqrt(variance), rel=0.05)


def test_the_log_density_differs_by_a_constant_from_the_closed_form(finished, line):
    run, _ = finished
    mean, covariance = closed_form(line[1])
    points = np.random.default_rng(1).multivariate_normal(mean, covariance, 20)
    residual = points - mean
    expected = -0.5 * np.einsum("ni,ij,nj->n", residual, np.linalg.inv(covariance), residual)
    found = run.posterior.log_density(points)
    # The emulator is exact up to rounding, and so is its stated error.
    np.testing.assert_allclose(found - found.mean(), expected - expected.mean(), atol=1e-3)
    single = run.posterior.log_density({"level0": points[0, 0], "rise": points[0, 1]})
    assert single == pytest.approx(found[0])


def test_the_emulator_is_the_line(finished):
    run, _ = finished
    emulator = run.emulator
    assert emulator.parameters == ["level0", "rise"]
    assert emulator.units == {"level0": "m", "rise": "m/s"}
    assert emulator.shape == (6,)
    prediction = emulator.predict({"level0": [0.1, 0.2], "rise": 0.3})
    np.testing.assert_allclose(prediction.mean, np.array([[0.1], [0.2]]) + 0.3 * TIMES, atol=1e-9)
    assert prediction.sd.shape == (2, 6)
    gradient = emulator.gradient([0.1, 0.3])
    np.testing.assert_allclose(gradient, np.column_stack([np.ones(6), TIMES]), atol=1e-9)
    with pytest.raises(ValueError, match="expected values of level0, rise, found level0, slope"):
        emulator.predict({"level0": 0.1, "slope": 0.3})
    with pytest.raises(ValueError, match="columns level0, rise"):
        emulator.predict(np.zeros((3, 4)))


def test_new_replicates_have_the_predictive_distribution_in_closed_form(finished, line):
    run, _ = finished
    mean, covariance = closed_form(line[1])
    design = np.column_stack([np.ones_like(TIMES), TIMES])
    of_parameters = np.einsum("ij,jk,ik->i", design, covariance, design)
    draws = 4000
    found = run.predict(draws=draws, seed=3)
    assert found.response.shape == found.replicate.shape == (draws, 6)
    # Errors are independent from draw to draw, the draws as many as their effective number.
    independent = min(value["ess_bulk"] for value in run.summary["parameters"].values())
    error = np.sqrt(NOISE**2 / draws + of_parameters / min(independent, draws))
    assert np.all(np.abs(found.mean - design @ mean) < 4 * error)
    np.testing.assert_allclose(found.sd, np.sqrt(of_parameters + NOISE**2), rtol=4 / np.sqrt(2 * draws) + 0.02)
    low, high = found.quantile(0.025), found.quantile(0.975)
    np.testing.assert_allclose(high - low, 2 * 1.96 * found.sd, rtol=0.1)

    single = run.predict({"level0": 0.1, "rise": 0.3})
    np.testing.assert_allclose(single.response, 0.1 + 0.3 * TIMES, atol=1e-9)
    assert single.replicate.shape == (6,)
    assert np.array_equal(run.predict(seed=1).replicate, run.predict(seed=1).replicate)
    assert not np.array_equal(run.predict(seed=1).replicate, run.predict(seed=2).replicate)


def test_a_run_tells_its_progress_and_is_reused(finished, study):
    run, events = finished
    stages = [event[1] for event in events if event[0] == "begin"]
    assert "calibrate" in stages
    again = []
    lacuna.run(study, out=run.folder, progress=lambda *event: again.append(event))
    assert not any(event[0] == "advance" for event in again), again


def test_results_are_tables(finished):
    run, _ = finished
    assert lacuna.load(run.folder).summary == run.summary
    table = run.to_pandas()
    assert table.loc["rise", "mean"] == run.summary["parameters"]["rise"]["mean"]
    draws = run.posterior.to_pandas()
    assert list(draws.columns) == ["level0", "rise"]
    assert draws["rise"].mean() == pytest.approx(run.posterior.mean()["rise"])
    data = run.to_inference_data()
    assert set(data.posterior.data_vars) == {"level0", "rise"}
    assert "level" in data.observed_data
    assert "rise" in run.text


def test_all_problems_of_a_study_are_told(study, tmp_path):
    wrong = {**study, "sampler": {"use": "affine_invariant_ensmble"}, "discrepancy": {"use": "gaussian", "sise": 3}}
    with pytest.raises(lacuna.StudyError) as told:
        lacuna.check(wrong)
    assert "did you mean `affine_invariant_ensemble`?" in str(told.value)
    assert "sise" in str(told.value)
    with pytest.raises(lacuna.StudyError, match="nowhere.toml"):
        lacuna.run(tmp_path / "nowhere.toml")
    with pytest.raises(FileNotFoundError, match="no finished run"):
        lacuna.load(tmp_path)
    with pytest.raises(TypeError, match="a study cannot contain object"):
        lacuna.check({"study": {"title": object()}})


def test_keywords_set_keys(study, tmp_path):
    run = lacuna.run(study, out=tmp_path / "r", progress=False, sampler__steps=600, study__seed=3)
    assert "steps = 600" in (run.folder / "resolved.toml").read_text()
    assert run.summary["seed"] == 3


def test_an_interrupted_run_goes_on(study, tmp_path):
    calls = []

    def interrupt(kind, *details):
        calls.append((kind, details))
        if kind == "begin" and details[0] == "calibrate":
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        lacuna.run(study, out=tmp_path / "r", progress=interrupt, sampler__steps=2000)
    assert not (tmp_path / "r" / "summary.json").exists()
    run = lacuna.run(study, out=tmp_path / "r", progress=False, sampler__steps=2000)
    assert "rise" in run.summary["parameters"]


def test_the_command_is_there(tmp_path):
    command = [sys.executable, "-m", "lacuna"]
    told = subprocess.run([*command, "--version"], capture_output=True, text=True)
    assert told.returncode == 0 and told.stdout == f"lacuna {lacuna.__version__}\n"
    told = subprocess.run([*command, "check", "nowhere.toml"], capture_output=True, text=True, cwd=tmp_path)
    assert told.returncode == 2 and "nowhere.toml" in told.stderr
