//! What is written opens in the tools of others: `arviz` reads the posterior, `netCDF4` the run files.
//!
//! `LACUNA_PYTHON` names an interpreter that has both; without it the tests say that they are skipped, unless
//! `LACUNA_REQUIRE_PYTHON=1` makes that a failure.

use std::ffi::OsString;
use std::path::Path;
use std::process::Command;

use crate::quick;

/// The interpreter that has these packages; `None` when there is none and none is required.
pub fn interpreter(packages: &str) -> Option<OsString> {
    let required = std::env::var_os("LACUNA_REQUIRE_PYTHON").is_some_and(|value| value == "1");
    let python = std::env::var_os("LACUNA_PYTHON");
    if python.is_none() {
        assert!(!required, "LACUNA_REQUIRE_PYTHON is set, but LACUNA_PYTHON names no interpreter");
        println!("skipped: LACUNA_PYTHON names no interpreter with {packages}");
    }
    python
}

/// What a script prints, as JSON; `None` when there is no interpreter and none is required.
fn python(script: &str, arguments: &[&Path]) -> Option<serde_json::Value> {
    let python = interpreter("arviz and netCDF4")?;
    let output = Command::new(python).arg("-c").arg(script).args(arguments).output().unwrap();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{errors}");
    let text = String::from_utf8(output.stdout).unwrap();
    Some(serde_json::from_str(text.lines().last().unwrap()).unwrap())
}

/// Mean and standard deviation of each variable, as arviz computes them, and the shapes of all groups.
const ARVIZ: &str = r"
import json, sys
import arviz as az
data = az.from_netcdf(sys.argv[1])
posterior = data.posterior
summary = az.summary(data, kind='stats', round_to='none')
found = {name: [float(summary.loc[name, 'mean']), float(summary.loc[name, 'sd'])] for name in summary.index}
sizes = {group: {str(k): int(v) for k, v in data[group].sizes.items()} for group in data.groups()}
units = {name: posterior[name].attrs['units'] for name in posterior.data_vars}
lp = float(data.sample_stats['lp'].mean())
print(json.dumps({'summary': found, 'sizes': sizes, 'units': units, 'lp': lp,
    'gauges': [str(s) for s in data.observed_data['sensor'].values]}))
";

#[test]
fn arviz_reads_the_posterior() {
    let folder = quick::simulated();
    let out = folder.path().join("run");
    let ran = quick::run(&folder.path().join("study.toml"), &[], &out);
    ran.unwrap_or_else(|stop| panic!("{stop}"));
    let Some(found) = python(ARVIZ, &[&out.join("posterior.nc")]) else { return };
    let parameters = quick::summary(&out)["parameters"].clone();
    for (name, ours) in parameters.as_object().unwrap() {
        for (i, key) in ["mean", "sd"].into_iter().enumerate() {
            let theirs = found["summary"][name][i].as_f64().unwrap();
            let ours = ours[key].as_f64().unwrap();
            assert!((theirs - ours).abs() <= 1e-6 * ours.abs(), "{name}.{key}: {theirs} {ours}");
        }
        assert_eq!(found["units"][name], ours["unit"]);
    }
    assert_eq!(found["summary"].as_object().unwrap().len(), parameters.as_object().unwrap().len());
    assert!(found["lp"].as_f64().unwrap().is_finite());
    assert_eq!(found["gauges"], serde_json::json!(["B", "C", "U"]));
    for group in ["posterior", "sample_stats"] {
        let sizes = &found["sizes"][group];
        assert_eq!((sizes["chain"].as_u64(), sizes["draw"].as_u64()), (Some(24), Some(30)));
    }
    for group in ["observed_data", "posterior_predictive"] {
        let sizes = &found["sizes"][group];
        assert_eq!((sizes["sensor"].as_u64(), sizes["time"].as_u64()), (Some(3), Some(20)));
    }
}

/// The times and the last value of every global variable of an Exodus history file, by the variables' names.
const NETCDF4: &str = r"
import json, sys
import netCDF4
data = netCDF4.Dataset(sys.argv[1])
netCDF4.chartostring
names = [b''.join(row.compressed() if hasattr(row, 'compressed') else row).decode().strip('\0 ')
         for row in data['name_glo_var'][:]]
values = data['vals_glo_var'][:]
times = data['time_whole'][:]
print(json.dumps({'times': [float(t) for t in times], 'version': float(data.version),
    'signals': {name: [float(v) for v in values[:, i]] for i, name in enumerate(names)}}))
";

#[test]
fn netcdf4_reads_the_run_files() {
    let folder = quick::simulated();
    let out = folder.path().join("run");
    let ran = quick::run(&folder.path().join("study.toml"), &["sampler.steps=20"], &out);
    ran.unwrap_or_else(|stop| panic!("{stop}"));
    let read = lacuna::run::arrays::read(&out.join("3-read/ensemble.nc"), "responses").unwrap();
    let ours = &read.values[..60];
    let Some(found) = python(NETCDF4, &[&out.join("2-simulate/run001.h")]) else { return };
    let times: Vec<f64> = serde_json::from_value(found["times"].clone()).unwrap();
    assert_eq!((times.len(), times[0], times[19]), (20, 1e-5, 2e-4));
    for (sensor, ours) in ["B", "C", "U"].into_iter().zip(ours.chunks(20)) {
        let name = format!("strain_{sensor}");
        let theirs: Vec<f64> = serde_json::from_value(found["signals"][name].clone()).unwrap();
        assert_eq!(theirs, ours, "{sensor}");
    }
}
