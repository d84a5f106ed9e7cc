//! Tests of the noise that discrepancies state.
#![allow(clippy::unwrap_used)]

use lacuna::plugin::discrepancy::Known;
use lacuna::plugin::{Discrepancy, registry};

use super::common::testing::{OUTPUTS, data, layout};

/// If nothing is unknown and nothing is shared, the stated noise is the likelihood's variance of a new replicate; if
/// something is unknown, no noise is stated.
#[test]
fn stated_noise_is_that_of_a_new_replicate() {
    let response: Vec<f64> = (0..OUTPUTS).map(|i| 1.0 + 0.3 * i as f64).collect();
    let by = "by = \"sensor\"";
    for (name, known, unknown) in [
        ("gaussian", format!("variance = {{ known = [0.1, 0.2, 0.4] }}\n{by}"), "variance"),
        (
            "autoregressive",
            format!(
                "variance = {{ known = [0.1, 0.2, 0.4] }}\n{by}\ncorrelation_time = {{ known = 2e-4 }}"
            ),
            "correlation_time",
        ),
        (
            "student_t",
            format!(
                "scale = {{ known = [0.3, 0.5, 0.7] }}\n{by}\ndegrees_of_freedom = {{ known = 5 }}"
            ),
            "scale",
        ),
        (
            "multiplicative_gaussian",
            format!("relative = {{ known = [0.01, 0.02, 0.05] }}\n{by}\nfloor = {{ known = 0.3 }}"),
            "floor",
        ),
    ] {
        let plugin =
            |text: &str| registry::from_text::<dyn Discrepancy>(name, text).unwrap().plugin;
        let data = data(3, 4);
        let stated = plugin(&known).stated_noise(&layout(), &response).unwrap();
        let likelihood = plugin(&known).likelihood(&Known::without_slopes(&data, &[])).unwrap();
        assert!(likelihood.hyperparameters().is_empty(), "{name}");
        let parts = likelihood.predictive(&response, &[]);
        // The last two outputs were never measured.
        for i in 0..OUTPUTS - 2 {
            let sum: f64 = parts.iter().map(|part| part.variance[i]).sum();
            assert!((stated.sd[i].powi(2) / sum - 1.0).abs() < 1e-12, "{name} {i}");
        }
        assert_eq!(stated.correlation_time.is_some(), name == "autoregressive");
        let line = known.lines().find(|line| line.starts_with(unknown)).unwrap();
        let open = known.replace(line, &format!("{unknown} = {{ half_normal = 1 }}"));
        assert!(plugin(&open).stated_noise(&layout(), &response).is_none(), "{name}");
    }
}
