//! Leave-one-out predictions of data and curves by complete runs, compared with predictions of posteriors without them:
//! a level with a normal prior and normal noise, for which every posterior has a closed form.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use tempfile::TempDir;

use crate::quick;

/// Mean and standard deviation of the prior of the level.
const PRIOR: [f64; 2] = [1.0, 2.0];
/// The variance of the noise.
const VARIANCE: f64 = 0.25;
/// Correlation time of the noise in the second study.
const TIME: f64 = 3.0;

/// Replicate, time and value.
pub type Datum = (usize, f64, f64);

/// Noise from a separate generator (Lehmer's, with normal numbers as sums of twelve uniform ones).
fn noise(state: &mut u64) -> f64 {
    let mut sum = -6.0;
    for _ in 0..12 {
        *state = *state * 48_271 % 2_147_483_647;
        sum += *state as f64 / 2_147_483_647.0;
    }
    sum
}

/// Replicates of six values around a level of two; with `gaps`, the third one has only four.
pub fn data(replicates: usize, gaps: bool) -> Vec<Datum> {
    let mut state = 20_240_117;
    let mut data = Vec::new();
    for replicate in 0..replicates {
        for time in 1..=6 {
            let value = 2.0 + VARIANCE.sqrt() * noise(&mut state);
            if !(gaps && replicate == 2 && time < 3) {
                data.push((replicate, f64::from(time), value));
            }
        }
    }
    data
}

/// A study of these data, in its own folder.
pub fn study(data: &[Datum], discrepancy: &str, steps: usize) -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let text = format!(
        r#"
        [study]
        title = "A level under noise"
        seed = 31
        [[parameter]]
        name = "level"
        unit = "V"
        prior = {{ normal = {PRIOR:?} }}
        reference = 2.0
        [response]
        name = "voltage"
        unit = "V"
        axes = {{ time = {{ first = 1.0, last = 6.0, count = 6, unit = "s" }} }}
        [model]
        use = "equations"
        observe = "level"
        [measurements]
        use = "csv"
        path = "voltage.csv"
        [discrepancy]
        {discrepancy}
        replicate_error = false
        [sampler]
        use = "no_u_turn"
        warm_up = 300
        steps = {steps}
        "#
    );
    let path = folder.path().join("study.toml");
    std::fs::write(&path, text).unwrap();
    let mut table = String::from("replicate,time [s],voltage [V]\n");
    for (replicate, time, value) in data {
        writeln!(table, "{replicate},{time},{value}").unwrap();
    }
    std::fs::write(folder.path().join("voltage.csv"), table).unwrap();
    (folder, path)
}

/// Discrepancy: independent noise of known variance.
pub fn independent() -> String {
    format!("use = \"gaussian\"\nvariance = {{ known = {VARIANCE:?} }}")
}

/// Discrepancy: noise whose correlation decays along a replicate.
fn correlated() -> String {
    format!(
        "use = \"autoregressive\"\nvariance = {{ known = {VARIANCE:?} }}\ncorrelation_time = {{ known = {TIME:?} }}"
    )
}

/// Log density of data with the level integrated out: normal around the prior mean, with the covariance of noise and
/// level. `time` is the correlation time of the noise, zero for independent noise.
fn log_density(data: &[Datum], time: f64) -> f64 {
    let n = data.len();
    let covariance = |a: &Datum, b: &Datum| {
        let same = if a.0 == b.0 { 1.0 } else { 0.0 };
        let gap = (a.1 - b.1).abs();
        let noise = if time > 0.0 { (-gap / time).exp() } else { f64::from(u8::from(gap == 0.0)) };
        PRIOR[1] * PRIOR[1] + VARIANCE * same * noise
    };
    // Cholesky factor row by row, solving for the whitened residual along the way.
    let mut factor = vec![vec![0.0; n]; n];
    let mut solved = vec![0.0; n];
    let mut twice = n as f64 * std::f64::consts::TAU.ln();
    for i in 0..n {
        for j in 0..=i {
            let inner: f64 = (0..j).map(|k| factor[i][k] * factor[j][k]).sum();
            let left = covariance(&data[i], &data[j]) - inner;
            factor[i][j] = if i == j { left.sqrt() } else { left / factor[j][j] };
        }
        let inner: f64 = (0..i).map(|k| factor[i][k] * solved[k]).sum();
        solved[i] = (data[i].2 - PRIOR[0] - inner) / factor[i][i];
        twice += solved[i] * solved[i] + 2.0 * factor[i][i].ln();
    }
    -0.5 * twice
}

/// Sum over all parts of the log density of a part given the rest.
fn left_out(data: &[Datum], time: f64, parts: usize, part: impl Fn(usize, &Datum) -> usize) -> f64 {
    let whole = log_density(data, time);
    let rest = |p: usize| -> Vec<Datum> {
        let numbered = data.iter().enumerate();
        numbered.filter(|(i, datum)| part(*i, datum) != p).map(|(_, datum)| *datum).collect()
    };
    (0..parts).map(|p| whole - log_density(&rest(p), time)).sum()
}

fn number(summary: &serde_json::Value, path: &str) -> f64 {
    summary.pointer(path).and_then(serde_json::Value::as_f64).unwrap_or_else(|| panic!("{path}"))
}

#[test]
fn data_and_curves_are_predicted_as_by_posteriors_without_them() {
    let data = data(10, true);
    for (discrepancy, time) in [(independent(), 0.0), (correlated(), TIME)] {
        let (folder, path) = study(&data, &discrepancy, 2300);
        let out = folder.path().join("run");
        quick::run(&path, &[], &out).unwrap_or_else(|stop| panic!("{stop}"));
        let summary = quick::summary(&out);
        let exact = left_out(&data, time, data.len(), |i, _| i);
        let exact_curves = left_out(&data, time, 10, |_, datum| datum.0);
        // A thousand draws of one unknown: the importance weights of a curve, a tenth of the data, have a coefficient
        // of variation of about 0.5, and each of ten curves an error of about 0.5 / sqrt(1000).
        let (found, curves) = (number(&summary, "/loo/elpd"), number(&summary, "/loo/curves/elpd"));
        assert!((found - exact).abs() < 0.05, "{time}: {found} and {exact}");
        assert!((curves - exact_curves).abs() < 0.2, "{time}: {curves} and {exact_curves}");
        assert_eq!(number(&summary, "/loo/count"), data.len() as f64);
        assert_eq!(number(&summary, "/loo/curves/count"), 10.0);
        for key in ["/loo/unreliable", "/loo/curves/unreliable"] {
            assert_eq!(number(&summary, key), 0.0, "{time} {key}");
        }
        assert!((number(&summary, "/loo/k_limit") - 2.0 / 3.0).abs() < 1e-12);
        assert!(number(&summary, "/loo/error_by_curve") > 0.0);
    }
}

#[test]
fn a_single_curve_is_not_predicted_from_nothing() {
    let (folder, path) = study(&data(1, false), &independent(), 600);
    let out = folder.path().join("run");
    quick::run(&path, &[], &out).unwrap_or_else(|stop| panic!("{stop}"));
    let loo = quick::summary(&out)["loo"].clone();
    assert!(loo["curves"].is_null() && loo["error_by_curve"].is_null(), "{loo}");
    assert!(loo["error"].as_f64().unwrap() > 0.0);
}

/// The bytes of `posterior.nc`.
fn file(out: &Path) -> Vec<u8> {
    std::fs::read(out.join("posterior.nc")).unwrap()
}

#[test]
fn the_file_of_draws_is_written_again_only_when_it_has_to_be() {
    let (folder, path) = study(&data(4, false), &independent(), 600);
    let out = folder.path().join("run");
    let run = |settings: &[&str]| {
        quick::run(&path, settings, &out).unwrap_or_else(|stop| panic!("{stop}"))
    };
    run(&[]);
    let first = file(&out);
    let written = || std::fs::metadata(out.join("posterior.nc")).unwrap().modified().unwrap();
    let before = written();
    run(&[]);
    assert_eq!(written(), before);
    // Another title gives another file; the first one is restored bit for bit, and so is a damaged one.
    run(&["study.title=\"Another\""]);
    assert_ne!(file(&out), first);
    run(&[]);
    assert_eq!(file(&out), first);
    std::fs::write(out.join("posterior.nc"), b"CDF").unwrap();
    run(&[]);
    assert_eq!(file(&out), first);
}
