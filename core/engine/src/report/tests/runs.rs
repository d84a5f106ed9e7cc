//! Made-up runs for the results of [`super::fixture`].

use lacuna::data::{FailedRun, Parameter};
use lacuna::math::random::{Stream, uniform};
use lacuna_linalg::Matrix;

use super::fixture::{RUNS, parameters};
use crate::report::findings::{EnsembleFindings, RunInput};
use crate::screening::{ActiveSubspace, Dependence, Screening};

/// Runs of which the first input hardly matters.
pub fn ensemble() -> EnsembleFindings {
    let mut rng = Stream::root(1).named("design").generator();
    let ranges = [[0.0, 1.5e7], [1e4, 1.6e4], [1e3, 3e3]];
    let points = Matrix::from_fn(RUNS, 3, |_, j| {
        ranges[j][0] + (ranges[j][1] - ranges[j][0]) * uniform(&mut rng)
    });
    let valid: Vec<bool> = points.iter_rows().map(|p| p[1] * p[2] < 4.6e7).collect();
    let input =
        |(j, p): (usize, Parameter)| RunInput { name: p.name, symbol: p.symbol, places: vec![j] };
    EnsembleFindings {
        inputs: parameters().into_iter().enumerate().map(input).collect(),
        valid,
        failed: vec![
            FailedRun { run: "run-0231".into(), reason: "exit status 137 after 3 attempts".into() },
            FailedRun { run: "run-0388".into(), reason: "strain of sensor `Y` is NaN".into() },
            FailedRun { run: "run-0412".into(), reason: "`out.e` ends at step 61 of 100".into() },
        ],
        in_prior: points.iter_rows().filter(|p| p[0] < 1.5e6 && p[2] < 1.9e3).count(),
        screening: Some(Screening::Dependence(vec![
            Dependence { index: 0.003, p: 0.41 },
            Dependence { index: 0.12, p: 1e-9 },
            Dependence { index: 0.31, p: 1e-12 },
        ])),
        active: Some(ActiveSubspace {
            eigenvalues: vec![0.9, 0.2, 0.004],
            spread: vec![(0.8, 1.0), (0.1, 0.3), (0.003, 0.005)],
            activity: vec![0.004, 0.2, 0.9],
            runs: 500,
        }),
        points,
    }
}
