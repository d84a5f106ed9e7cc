//! A study with effects compared with a closed form.

use std::fs;
use std::path::Path;

use crate::quick;

/// True values of the measurements: height, and gain and delay of the far sensor.
const TRUTH: [f64; 3] = [2.0, 1.08, 0.137];
/// Means and standard deviations of the priors.
const PRIORS: [(f64, f64); 3] = [(2.5, 1.0), (1.0, 0.1), (0.0, 0.2)];
const NOISE: f64 = 0.05;

fn bump(t: f64, centre: f64) -> f64 {
    (-2.0 * (t - centre) * (t - centre)).exp()
}

fn times() -> impl Iterator<Item = f64> {
    (0..61).map(|i| 0.1 * f64::from(i))
}

/// Inverse of a symmetric 3 x 3 matrix, by cofactors.
fn inverse(m: [[f64; 3]; 3]) -> [[f64; 3]; 3] {
    let minor = |i: usize, j: usize| {
        let (a, b, c, d) = ((i + 1) % 3, (i + 2) % 3, (j + 1) % 3, (j + 2) % 3);
        m[a][c] * m[b][d] - m[a][d] * m[b][c]
    };
    let determinant: f64 = (0..3).map(|j| m[0][j] * minor(0, j)).sum();
    [0, 1, 2].map(|i| [0, 1, 2].map(|j| minor(j, i) / determinant))
}

/// Mean and standard deviation of each unknown for the model linearised at the truth, which the noise-free measurements
/// equal: with `P` the precision of the priors and `J` the derivatives, `V = (J'J / s² + P)⁻¹`, and the mean is the
/// truth plus `V P (m - truth)` for priors of mean `m`.
fn closed_form() -> [(f64, f64); 3] {
    let [height, gain, delay] = TRUTH;
    let near = times().map(|t| [bump(t, 2.0), 0.0, 0.0]);
    let far = times().map(|t| {
        let value = bump(t, 3.0 + delay);
        [gain * value, height * value, height * gain * 4.0 * (t - 3.0 - delay) * value]
    });
    let mut precision = [[0.0; 3]; 3];
    for row in near.chain(far) {
        for i in 0..3 {
            for j in 0..3 {
                precision[i][j] += row[i] * row[j] / (NOISE * NOISE);
            }
        }
    }
    let pull: Vec<f64> = (0..3)
        .map(|i| {
            let weight = PRIORS[i].1.powi(-2);
            precision[i][i] += weight;
            weight * (PRIORS[i].0 - TRUTH[i])
        })
        .collect();
    let covariance = inverse(precision);
    [0, 1, 2].map(|i| {
        let shift: f64 = covariance[i].iter().zip(&pull).map(|(v, p)| v * p).sum();
        (TRUTH[i] + shift, covariance[i][i].sqrt())
    })
}

fn write_measurements(path: &Path) {
    let [height, gain, delay] = TRUTH;
    let mut text = "replicate,sensor,t [s],level [mm]\n".to_owned();
    for t in times() {
        text += &format!("1,near,{t:.1},{}\n", height * bump(t, 2.0));
        text += &format!("1,far,{t:.1},{}\n", gain * height * bump(t, 3.0 + delay));
    }
    fs::write(path, text).unwrap();
}

/// The sampled means are within four Monte Carlo errors of the closed form, plus a tenth of a standard deviation for
/// nonlinearity and for the spline of the delay; the standard deviations within 10 %.
#[test]
fn a_gain_and_a_delay_are_found_with_the_parameter() {
    let folder = tempfile::tempdir().unwrap();
    let study = folder.path().join("study.toml");
    fs::copy(quick::root().join("tests/effects/study.toml"), &study).unwrap();
    write_measurements(&folder.path().join("level.csv"));
    let out = folder.path().join("run");
    quick::run(&study, &[], &out).unwrap_or_else(|stop| panic!("{stop}"));
    let found = quick::summary(&out);
    assert_eq!(found["converged"], true, "{}", found["verdict"]);
    let names = ["height", "gain.factor", "cable.time"];
    for (name, (mean, sd)) in names.into_iter().zip(closed_form()) {
        let own = &found["parameters"][name];
        let number = |key: &str| own[key].as_f64().unwrap_or_else(|| panic!("{name}: {own}"));
        let error = 0.1 + 4.0 / number("ess_bulk").min(number("ess_tail")).sqrt();
        let off = (number("mean") - mean).abs() / sd;
        assert!(off < error, "the mean of {name} is {} and not {mean} ± {sd}", number("mean"));
        assert!((number("sd") / sd - 1.0).abs() < 0.1, "{name}: sd {} and not {sd}", number("sd"));
    }
    // The response at the MAP has the effects: without them it is off by more than three times the noise.
    let rmse = found["rmse"]["map"].as_f64().unwrap();
    assert!(rmse < 0.5 * NOISE, "{rmse}");
    assert_eq!(found["parameters"]["cable.time"]["unit"], "s");
    assert_eq!(found["parameters"]["cable.time"]["role"], "hyperparameter");
}
