//! Files can be opened with standard tools: `arviz` reads the posterior, `netCDF4` the run files.
//!
//! `LACUNA_PYTHON` names an interpreter that has both; without it the tests report that they are skipped, unless
//! `LACUNA_REQUIRE_PYTHON=1` makes that a failure.

use std::ffi::OsString;
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{ChildStdin, ChildStdout, Command, Stdio};
use std::sync::{Mutex, PoisonError};

use crate::{left_out, quick};

/// The interpreter that has these packages; `None` if there is none and none is required.
pub fn interpreter(packages: &str) -> Option<OsString> {
    let required = std::env::var_os("LACUNA_REQUIRE_PYTHON").is_some_and(|value| value == "1");
    let python = std::env::var_os("LACUNA_PYTHON");
    if python.is_none() {
        assert!(!required, "LACUNA_REQUIRE_PYTHON is set, but LACUNA_PYTHON names no interpreter");
        println!("skipped: LACUNA_PYTHON names no interpreter with {packages}");
    }
    python
}

/// Runs scripts, each in a process of its own that has imported arviz: the import takes longer than most of them.
const SERVER: &str = r"
import json, os, sys
import arviz
for line in sys.stdin:
    script, arguments, printed = json.loads(line)
    child = os.fork()
    if child == 0:
        for stream in (1, 2):
            os.dup2(os.open(printed, os.O_WRONLY | os.O_CREAT | os.O_APPEND), stream)
        sys.argv[1:] = arguments
        exec(compile(script, 'script', 'exec'), {'__name__': '__main__'})
        sys.stdout.flush()
        os._exit(0)
    print(os.waitpid(child, 0)[1], flush=True)
";

/// The process of [`SERVER`], which ends with the tests, with its questions and answers.
static SERVING: Mutex<Option<(ChildStdin, BufReader<ChildStdout>)>> = Mutex::new(None);

/// Output of a script as JSON; `None` if there is no interpreter and none is required.
fn python(script: &str, arguments: &[&Path]) -> Option<serde_json::Value> {
    let python = interpreter("arviz and netCDF4")?;
    let folder = tempfile::tempdir().unwrap();
    let printed = folder.path().join("printed");
    let mut serving = SERVING.lock().unwrap_or_else(PoisonError::into_inner);
    let (questions, answers) = serving.get_or_insert_with(|| {
        let mut command = Command::new(python);
        command.args(["-c", SERVER]).stdin(Stdio::piped()).stdout(Stdio::piped());
        #[expect(clippy::zombie_processes, reason = "it ends with the tests")]
        let mut server = command.spawn().unwrap();
        (server.stdin.take().unwrap(), BufReader::new(server.stdout.take().unwrap()))
    });
    writeln!(questions, "{}", serde_json::json!([script, arguments, printed])).unwrap();
    let mut status = String::new();
    answers.read_line(&mut status).unwrap();
    let text = std::fs::read_to_string(&printed).unwrap_or_default();
    assert_eq!(status, "0\n", "{text}");
    Some(serde_json::from_str(text.lines().last().unwrap()).unwrap())
}

/// Probabilities of values below the data under their leave-one-out predictions, from the groups of `posterior.nc`.
const LOO_PIT: &str = r"
import json, sys
import arviz as az
import numpy as np
data = az.from_netcdf(sys.argv[1])
name = next(iter(data.log_likelihood.data_vars))
rows = lambda group: data[group][name].stack(draws=('chain', 'draw')).transpose('draws', ...).values
density, simulated = (rows(group).reshape(rows(group).shape[0], -1) for group in ('log_likelihood', 'posterior_predictive'))
measured = data.observed_data[name].values.ravel()
known = np.isfinite(measured)
weights, _ = az.psislw(-density[:, known].T, reff=1.0)
pit = az.loo_pit(y=measured[known], y_hat=simulated[:, known].T, log_weights=weights)
print(json.dumps([float(p) for p in pit]))
";

#[test]
fn arviz_places_the_data_in_their_predictions_as_we_do() {
    let folder = quick::simulated();
    let out = folder.path().join("run");
    let ran = quick::run(&folder.path().join("study.toml"), &[], &out);
    ran.unwrap_or_else(|stop| panic!("{stop}"));
    let Some(theirs) = python(LOO_PIT, &[&out.join("posterior.nc")]) else { return };
    let kept = lacuna_run::arrays::read(&out.join("6-evidence/left_out.nc"), "below").unwrap();
    let theirs: Vec<f64> = serde_json::from_value(theirs).unwrap();
    let mut ours = kept.into_values();
    assert_eq!(ours.len(), theirs.len());
    // The file has the data in the order of its axes, the run by replicate; the draws are not independent, so that the
    // length of the smoothed tail, and with it the weights, differ a little.
    let mut sorted = theirs.clone();
    sorted.sort_by(f64::total_cmp);
    ours.sort_by(f64::total_cmp);
    let farthest = ours.iter().zip(&sorted).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(farthest < 0.01, "{farthest}");
}

/// Mean and standard deviation of each variable as computed by arviz, and the shapes of all groups.
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

/// Mean and standard deviation of each predicted quantity, and its unit.
const PREDICTED: &str = r"
import json, sys
import arviz as az
group = az.from_netcdf(sys.argv[1]).posterior_predictive
names = ['peak_B', 'peak_C', 'sum']
print(json.dumps({n: [float(group[n].mean()), float(group[n].std(ddof=1)), group[n].attrs['units'],
    list(group[n].dims)] for n in names}))
";

#[test]
fn arviz_reads_the_predicted_quantities() {
    let folder = quick::simulated();
    let out = folder.path().join("run");
    let asked = "quantity=[{ name = 'peak', use = 'maximum', on = { sensor = ['B', 'C'] } }, \
                 { name = 'sum', use = 'expression', formula = 'peak_B + peak_C' }]";
    let ran = quick::run(&folder.path().join("study.toml"), &[asked], &out);
    ran.unwrap_or_else(|stop| panic!("{stop}"));
    let Some(found) = python(PREDICTED, &[&out.join("posterior.nc")]) else { return };
    let summary = quick::summary(&out);
    for (name, theirs) in found.as_object().unwrap() {
        let ours = &summary["quantities"][name];
        for (i, key) in ["mean", "sd"].into_iter().enumerate() {
            let (theirs, ours) = (theirs[i].as_f64().unwrap(), ours[key].as_f64().unwrap());
            assert!((theirs - ours).abs() <= 1e-9 * ours.abs(), "{name}.{key}: {theirs} {ours}");
        }
        assert_eq!(
            (&theirs[2], &theirs[3]),
            (&ours["unit"], &serde_json::json!(["chain", "draw"]))
        );
    }
}

/// Applies ArviZ to a run and to another one of the same data, including every function that needs more than draws.
const WHOLE: &str = r"
import json, sys, warnings
import matplotlib
matplotlib.use('Agg')
import arviz as az
warnings.simplefilter('ignore')
data, other = (az.from_netcdf(path) for path in sys.argv[1:])
name = list(data.observed_data.data_vars)[0]
def told(loo):
    return {'elpd': float(loo.elpd_loo), 'error': float(loo.se), 'parameters': float(loo.p_loo),
        'unreliable': int((loo.pareto_k > loo.good_k).sum()), 'k_limit': float(loo.good_k),
        'count': int(loo.n_data_points)}
reff = lambda group: float(group.attrs['relative_efficiency'])
curves = az.InferenceData(posterior=data.posterior, log_likelihood=data.log_likelihood_by_curve)
compared = az.compare({'data': data, 'other': other})
az.plot_ppc(data)
az.plot_ppc(data, group='prior')
az.plot_loo_pit(data, y=name)
has_energy = 'energy' in data.sample_stats
if has_energy:
    az.plot_energy(data)
stats = data.sample_stats
draws = data.posterior_predictive[name]
print(json.dumps({
    'names': {group: sorted(data[group].data_vars) for group in data.groups()},
    'loo': told(az.loo(data, pointwise=True)),
    'told_efficiency': told(az.loo(data, pointwise=True, reff=reff(data.log_likelihood))),
    'curves': told(az.loo(curves, pointwise=True, reff=reff(data.log_likelihood_by_curve))),
    'curve_names': [str(c) for c in data.log_likelihood_by_curve['curve'].values],
    'waic': float(az.waic(data).elpd_waic),
    'first': str(compared.index[0]), 'diff': float(compared['elpd_diff'].iloc[1]), 'dse': float(compared['dse'].iloc[1]),
    'bfmi': [float(b) for b in az.bfmi(data)] if has_energy else [],
    'kinds': {n: str(stats[n].dtype) for n in stats.data_vars},
    'energy': [float(stats['energy'].mean()), float(-stats['lp'].mean())] if has_energy else [],
    'largest': [int(stats['n_steps'].max()), 2 ** int(stats['tree_depth'].max()) - 1] if has_energy else [],
    'diverging': int(stats['diverging'].sum()) if has_energy else -1,
    'dims': list(draws.dims), 'coordinates': sorted(str(c) for c in draws.coords),
    'predictive': [float(draws.mean()), float(draws.std())],
    'observed': int(data.observed_data[name].count()),
    'prior': [float(data.prior[list(data.prior.data_vars)[0]].mean()), float(data.prior_predictive[name].std())],
    'attributes': {str(k): str(v) for k, v in data.posterior.attrs.items()},
    'constants': sorted(data.constant_data.data_vars),
}))
";

/// Runs a study twice, the second time with too small a noise, and compares both with `arviz`.
fn weighed(gaps: bool, steps: usize) -> Option<(serde_json::Value, [serde_json::Value; 2])> {
    let data = left_out::data(8, gaps);
    let (folder, path) = left_out::study(&data, &left_out::independent(), steps);
    let runs = [folder.path().join("run"), folder.path().join("other")];
    for (out, setting) in runs.iter().zip([None, Some("discrepancy.variance.known=0.05")]) {
        let settings: Vec<&str> = setting.into_iter().collect();
        quick::run(&path, &settings, out).unwrap_or_else(|stop| panic!("{stop}"));
    }
    let files = runs.each_ref().map(|out| out.join("posterior.nc"));
    let found = python(WHOLE, &[&files[0], &files[1]])?;
    Some((found, runs.each_ref().map(|out| quick::summary(out))))
}

fn agree(found: &serde_json::Value, ours: &serde_json::Value) {
    for key in ["elpd", "error", "parameters", "unreliable", "count", "k_limit"] {
        let Some(own) = ours[key].as_f64() else { continue };
        let theirs = found[key].as_f64().unwrap();
        assert!((theirs - own).abs() <= 1e-9 * own.abs().max(1.0), "{key}: {theirs} and {own}");
    }
}

#[test]
fn arviz_judges_predictions_as_we_do() {
    // All 1000 draws are in the file, so no option is needed. With missing values the data are stored one after
    // another.
    for gaps in [false, true] {
        let Some((found, [ours, other])) = weighed(gaps, 550) else { return };
        agree(&found["loo"], &ours["loo"]);
        agree(&found["told_efficiency"], &ours["loo"]);
        agree(&found["curves"], &ours["loo"]["curves"]);
        assert_eq!(found["curve_names"].as_array().unwrap().len(), 8);
        assert_eq!(found["first"], "data");
        let behind = ours["loo"]["elpd"].as_f64().unwrap() - other["loo"]["elpd"].as_f64().unwrap();
        assert!((found["diff"].as_f64().unwrap() - behind).abs() < 1e-8, "{found} {behind}");
        let waic = found["waic"].as_f64().unwrap();
        assert!((waic - ours["loo"]["elpd"].as_f64().unwrap()).abs() < 0.2, "{waic}");
        assert_eq!(found["observed"], ours["loo"]["count"]);
        let dims = found["dims"].to_string();
        let expected = if gaps {
            r#"["chain","draw","datum"]"#
        } else {
            r#"["chain","draw","replicate","time"]"#
        };
        assert_eq!(dims, expected);
        let coordinates = found["coordinates"].to_string();
        assert!(
            coordinates.contains(if gaps { "datum_time" } else { "\"time\"" }),
            "{coordinates}"
        );
        // Around a level of 2 with noise of variance 0.25; from the prior with variance 4 + 0.25, for 500 draws.
        let pair = |key: &str| [0, 1].map(|i| found[key][i].as_f64().unwrap());
        let [mean, sd] = pair("predictive");
        assert!((mean - 2.0).abs() < 0.3 && (sd - 0.5).abs() < 0.03, "{mean} {sd}");
        let [prior, spread] = pair("prior");
        assert!((prior - 1.0).abs() < 4.0 * 2.0 / 500_f64.sqrt(), "{prior}");
        assert!((spread - 4.25_f64.sqrt()).abs() < 4.0 * 2.06 / 1000_f64.sqrt(), "{spread}");
    }
}

#[test]
fn arviz_finds_what_a_hamiltonian_sampler_tells() {
    // 4000 draws, of which 1000 are used for predictions.
    let Some((found, [ours, _])) = weighed(false, 1300) else { return };
    agree(&found["told_efficiency"], &ours["loo"]);
    let stats =
        ["acceptance_rate", "diverging", "energy", "lp", "n_steps", "reached_max_treedepth"];
    let stats = [&stats[..], &["step_size", "tree_depth"]].concat();
    assert_eq!(found["names"]["sample_stats"], serde_json::json!(stats));
    for (name, kind) in [("diverging", "bool"), ("tree_depth", "int64"), ("energy", "float64")] {
        assert_eq!(found["kinds"][name], kind, "{name}");
    }
    assert_eq!(found["diverging"], 0);
    for bfmi in found["bfmi"].as_array().unwrap() {
        // For a normal distribution in one dimension the energy is half a chi-squared variable with two degrees of
        // freedom, and each new momentum changes half of it (Betancourt, arXiv 1604.00695): BFMI is about one.
        assert!((0.6..1.6).contains(&bfmi.as_f64().unwrap()), "{bfmi}");
    }
    // One unknown has a mean kinetic energy of one half.
    let [energy, lp] = [0, 1].map(|i| found["energy"][i].as_f64().unwrap());
    assert!((energy - lp - 0.5).abs() < 0.1, "{energy} {lp}");
    let [steps, tree] = [0, 1].map(|i| found["largest"][i].as_i64().unwrap());
    assert!(steps <= tree && steps > 0, "{steps} {tree}");
    assert_eq!(found["attributes"]["inference_library"], "lacuna");
    assert_eq!(found["constants"], serde_json::json!(["level_reference"]));
}

/// Times and last value of every global variable of an Exodus history file, by variable name.
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
    let read = lacuna_run::arrays::read(&out.join("3-read/ensemble.nc"), "responses").unwrap();
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
