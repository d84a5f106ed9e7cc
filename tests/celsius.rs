//! A response in degrees Celsius: its errors are in kelvin, whatever describes them.

use crate::quick;

/// Newton's law of cooling with the truth `start = 60`, `rate = 0.05`, and five replicates with an error of 0.3 K.
const STUDY: &str = r#"
[study]
title = "A body that cools"

[[parameter]]
name = "start"
unit = "K"
prior = { uniform = [40.0, 80.0] }

[[parameter]]
name = "rate"
unit = "1/min"
prior = { log_uniform = [0.01, 0.2] }

[response]
name = "temperature"
unit = "degC"
axes = { time = { first = 0.0, last = 60.0, count = 31, unit = "min" } }

[model]
use = "equations"
observe = "20 {degC} + start * exp(-rate * time)"

[measurements]
use = "csv"
path = "cooling.csv"

[sampler]
use = "affine_invariant_ensemble"
walkers = 30
steps = 200
"#;

#[test]
fn discrepancies_take_degrees_celsius() {
    use lacuna::math::random::{Stream, normal};
    let folder = tempfile::tempdir().unwrap();
    let mut rng = Stream::root(3).generator();
    let mut table = "replicate,time [min],temperature [degC]\n".to_owned();
    for replicate in 0..5 {
        for time in (0..=60).step_by(2) {
            let truth = 20.0 + 60.0 * (-0.05 * f64::from(time)).exp();
            table += &format!("{replicate},{time},{}\n", truth + 0.3 * normal(&mut rng));
        }
    }
    std::fs::write(folder.path().join("cooling.csv"), table).unwrap();
    for (name, options, unit) in [
        ("gaussian", "variance = { half_normal = 1.0 }", "K^2"),
        ("student_t", "scale = { half_normal = 1.0 }\ndegrees_of_freedom = { known = 5 }", "K"),
        (
            "autoregressive",
            "variance = { half_normal = 1.0 }\ncorrelation_time = { log_normal = [0, 1] }",
            "K^2",
        ),
        (
            "gaussian_process",
            "bias = { half_normal = 1.0 }\ncorrelation_length = { log_normal = [2, 1] }\nvariance = { half_normal = 1.0 }",
            "K",
        ),
    ] {
        let study = folder.path().join(format!("{name}.toml"));
        std::fs::write(&study, format!("{STUDY}\n[discrepancy]\nuse = \"{name}\"\n{options}\n"))
            .unwrap();
        let out = folder.path().join(name);
        quick::run(&study, &[], &out).unwrap_or_else(|stop| panic!("{name}: {stop}"));
        let parameters = quick::summary(&out)["parameters"].clone();
        let found = |key: &str| parameters["rate"][key].as_f64().unwrap();
        assert!((found("mean") - 0.05).abs() < 4.0 * found("sd"), "{name}: {parameters}");
        let units: Vec<&str> =
            parameters.as_object().unwrap().values().filter_map(|p| p["unit"].as_str()).collect();
        assert!(units.contains(&unit), "{name}: {units:?}");
    }
}
