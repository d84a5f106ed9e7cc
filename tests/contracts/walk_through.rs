//! The example discrepancy of CONTRIBUTING.md, in a study.

#[path = "../../examples/shot_noise.rs"]
mod shot_noise;

use lacuna::run::Silent;
use lacuna_engine::study::resolve;
use lacuna_run::RunDirectory;

/// Three readings of a level with a gain that is almost known.
const STUDY: &str = "
[study]
name = 'counts'
title = 'A level from three readings with shot noise'
seed = 1

[[parameter]]
name = 'level'
prior = { uniform = [1, 40] }

[response]
name = 'reading'
axes = { t = { first = 1, last = 3, count = 3, unit = 's' } }

[model]
use = 'equations'
observe = 'level'

[measurements]
use = 'csv'
path = 'readings.csv'

[discrepancy]
use = 'shot_noise'
gain = { uniform = [0.4999, 0.5001] }
replicate_error = false

[sampler]
use = 'affine_invariant_ensemble'
walkers = 40
steps = 2000
";

const READINGS: [f64; 3] = [9.0, 10.0, 12.5];

/// With a flat prior and the gain `g`, three readings `y` of one level give it the density
/// `m^(-3/2) exp(-3 m / 2 g - Σy² / 2 g m)`: the inverse Gaussian distribution with mean `sqrt(Σy² / 3)` and shape
/// `Σy² / g`, whose variance is `mean³ / shape` (Johnson, Kotz and Balakrishnan, Continuous Univariate Distributions 1
/// (1994), chapter 15).
#[test]
fn the_level_behind_three_readings_is_inverse_gaussian() {
    let folder = tempfile::tempdir().unwrap();
    let rows = READINGS.iter().enumerate().map(|(i, y)| format!("1,{},{y}\n", i + 1));
    let table = format!("replicate,t,reading\n{}", rows.collect::<String>());
    std::fs::write(folder.path().join("readings.csv"), table).unwrap();
    let path = folder.path().join("study.toml");
    std::fs::write(&path, STUDY).unwrap();

    let checked = resolve::load(&path, &[]);
    let complaints = checked.complaints();
    let study = checked.study.unwrap_or_else(|| panic!("{complaints}"));
    let out = folder.path().join("run");
    lacuna_engine::pipeline::run(&study, &mut RunDirectory::open(&out).unwrap(), &Silent).unwrap();
    let summary = std::fs::read_to_string(out.join("summary.json")).unwrap();
    let summary: serde_json::Value = serde_json::from_str(&summary).unwrap();
    let level = &summary["parameters"]["level"];
    let [mean, sd, size] = ["mean", "sd", "ess_bulk"].map(|key| level[key].as_f64().unwrap());

    let squares: f64 = READINGS.iter().map(|y| y * y).sum();
    let (centre, shape) = ((squares / 3.0).sqrt(), squares / 0.5);
    let width = (centre.powi(3) / shape).sqrt();
    // The relative error of a standard deviation is about one over the square root of twice the number of draws.
    let error = width / size.sqrt();
    assert!((mean - centre).abs() < 4.0 * error, "{mean} ± {error} and {centre}");
    assert!((sd - width).abs() < 4.0 * error, "{sd} ± {error} and {width}");
    assert!(error < 0.05 * width, "{size} draws");
}
