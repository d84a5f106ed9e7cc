"""Opens what a run left behind with tools that others wrote: `check_run.py RUN`."""

import json
import sys
from pathlib import Path

import arviz

run = Path(sys.argv[1])
summary = json.loads((run / "summary.json").read_text())
assert summary["schema"] == 1, summary["schema"]
data = arviz.from_netcdf(run / "posterior.nc")
for group in ("posterior", "sample_stats", "observed_data"):
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
page = (run / "report.html").read_text()
for loaded in ('src="http', "src='http", 'rel="stylesheet"', "@import"):
    assert loaded not in page, f"the report loads something: {loaded}"
print(f"{run}: {len(names)} unknowns, {chains} chains x {kept} draws; ArviZ agrees")
