//! Comparison with the two surrogates that it combines.

use super::*;
use crate::surrogates::gaussian_process::GaussianProcess;
use crate::surrogates::gaussian_process::tests::{Case, ishigami, rmse};

/// Returns the errors of the Gaussian process, the expansion, and both combined.
fn errors(case: &Case) -> [f64; 3] {
    let (stream, progress) = (Stream::root(1), Progress::new(&Silent));
    let training = case.training();
    let plain =
        GaussianProcess::default().krige(&training, &stream, &progress, Tasks::here()).unwrap();
    let chaos = PolynomialChaos::default().expand(&training, &stream, &progress).unwrap();
    let both = PolynomialChaosKriging::default()
        .krige(&training, &stream, &progress, Tasks::here())
        .unwrap();
    let error = |emulator: &dyn Emulator| rmse(&emulator.mean(&case.fresh), &case.exact)[0];
    [error(&plain), error(&chaos), error(&both)]
}

/// At most a tenth worse than the better of the two: the choice is made on 100 runs.
#[test]
fn it_is_as_good_as_the_better_of_the_two() {
    // A polynomial with a bump that polynomials resolve badly; a product of waves; a cubic.
    let bump = |u: &[f64]| {
        let (x, y) = (2.0 * u[0] - 1.0, 2.0 * u[1] - 1.0);
        x.powi(3) - 2.0 * x * y
            + y * y
            + 0.5 * (-((x - 0.2).powi(2) + (y + 0.3).powi(2)) / 0.08).exp()
    };
    let cubic = |u: &[f64]| (1.0 + u[0]) * (u[1] - 0.3 * u[2]) + u[2].powi(3);
    for (name, case) in [
        ("bump", Case::new(2, bump)),
        ("ishigami", Case::new(3, ishigami)),
        ("cubic", Case::new(3, cubic)),
    ] {
        let [plain, chaos, both] = errors(&case);
        assert!(both <= 1.1 * plain.min(chaos) + 1e-9, "{name}: {both} {plain} {chaos}");
    }
}

#[test]
fn what_is_wrong_with_the_trend_is_said_at_its_place() {
    let built = lacuna::plugin::registry::from_text::<dyn Surrogate>(
        NAME,
        "selection = \"sequential\"\ntrend = { degree = 4, q_norm = 0.8 }",
    );
    assert!(built.is_ok());
    assert!(
        lacuna::plugin::registry::from_text::<dyn Surrogate>(NAME, "trend = { order = 4 }")
            .is_err()
    );
}
