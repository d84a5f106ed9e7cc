"""Opens what a run left behind with tools that others wrote: `check_run.py RUN`."""

import json
import sys
import warnings
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import arviz  # noqa: E402  the figures need no screen
import jsonschema  # noqa: E402

run = Path(sys.argv[1])
summary = json.loads((run / "summary.json").read_text())
assert summary["schema"] == 1, summary["schema"]
schema = Path(__file__).resolve().parent.parent / "docs" / "summary.schema.json"
jsonschema.validate(summary, json.loads(schema.read_text()), jsonschema.Draft202012Validator)
data = arviz.from_netcdf(run / "posterior.nc")
GROUPS = ("posterior", "sample_stats", "observed_data", "log_likelihood", "log_likelihood_by_curve",
          "posterior_predictive", "prior", "prior_predictive", "constant_data")
for group in GROUPS:
    assert group in data.groups(), (group, data.groups())
names = sorted(data.posterior.data_vars)
assert names == sorted(summary["parameters"]), names
chains, steps = summary["chains"]["count"], summary["chains"]["steps"]
kept = steps - summary["chains"]["burn_in"]
assert dict(data.posterior.sizes) == {"chain": chains, "draw": kept}, data.posterior.sizes
for name in names:
    told = summary["parameters"][name]
    draws = data.posterior[name].values
    error = abs(draws.mean() - told["mean"]) / told["sd"]
    assert error < 1e-9, (name, draws.mean(), told["mean"])
    assert 0 < told["mcse_mean"] < told["sd"], (name, told["mcse_mean"], told["sd"])
    for key, computed in (
        ("r_hat", arviz.rhat(draws)),
        ("ess_bulk", arviz.ess(draws)),
        ("ess_tail", arviz.ess(draws, method="tail")),
    ):
        assert abs(computed - told[key]) < 0.01 * told[key], (name, key, computed, told[key])
# Predictions of left-out data and curves, by ArviZ and by us.
warnings.simplefilter("ignore")
curves = arviz.InferenceData(posterior=data.posterior, log_likelihood=data.log_likelihood_by_curve)
for told, predicted, group in (
    (summary["loo"], data, data.log_likelihood),
    (summary["loo"]["curves"], curves, data.log_likelihood_by_curve),
):
    loo = arviz.loo(predicted, pointwise=True, reff=float(group.attrs["relative_efficiency"]))
    for key, found in (
        ("elpd", loo.elpd_loo),
        ("error", loo.se),
        ("parameters", loo.p_loo),
        ("count", loo.n_data_points),
        ("unreliable", int((loo.pareto_k > loo.good_k).sum())),
    ):
        assert abs(found - told[key]) <= 1e-8 * max(1.0, abs(told[key])), (key, found, told[key])
assert summary["loo"]["error_by_curve"] > 0
arviz.waic(data)
arviz.summary(data)
response = list(data.observed_data.data_vars)[0]
arviz.plot_ppc(data, num_pp_samples=20)
arviz.plot_loo_pit(data, y=response)
page = (run / "report.html").read_text()
for loaded in ('src="http', "src='http", 'rel="stylesheet"', "@import"):
    assert loaded not in page, f"the report loads something: {loaded}"
print(f"{run}: {len(names)} unknowns, {chains} chains x {kept} draws; ArviZ agrees; {summary['loo']['count']} data predicted from "
      f"{data.log_likelihood.sizes['chain'] * data.log_likelihood.sizes['draw']} draws")
