//! Errors and times of surrogates on published functions of many inputs.

use std::time::Instant;

use lacuna::math::random::Stream;
use lacuna::plugin::Design as _;
use lacuna::plugin::surrogate::Surrogate;
use lacuna_linalg::Matrix;

use super::functions::{Function, borehole, diffusion, morris, uqlab, welch};
use super::{fitted, parameters, share, values};
use crate::designs::latin_hypercube::LatinHypercube;
use crate::surrogates::gaussian_process::GaussianProcess;
use crate::surrogates::partial_least_squares::PartialLeastSquares;
use crate::surrogates::polynomial_chaos::{Degree, DegreeRange, PolynomialChaos, QNorm};

/// Surrogates to compare; `SURROGATES` in the environment selects some by name.
fn surrogates() -> Vec<(&'static str, Box<dyn Surrogate>)> {
    let pce = PolynomialChaos::default();
    let narrow = PolynomialChaos {
        q_norm: QNorm::List(vec![0.5, 0.75]),
        degree: Degree::Range(DegreeRange { min: 1, max: 5 }),
        max_interaction: Some(2),
        max_terms: Some(20_000),
        ..pce.clone()
    };
    let linear = PartialLeastSquares { refinements: 0, ..PartialLeastSquares::default() };
    let all: Vec<(&'static str, Box<dyn Surrogate>)> = vec![
        ("pce", Box::new(pce)),
        ("pce_narrow", Box::new(narrow)),
        ("pls", Box::new(PartialLeastSquares::default())),
        ("pls_linear", Box::new(linear)),
        ("gp", Box::new(GaussianProcess::default())),
    ];
    let chosen = std::env::var("SURROGATES").unwrap_or_default();
    let is_chosen = |name: &str| chosen.is_empty() || chosen.split(',').any(|one| one == name);
    all.into_iter().filter(|(name, _)| is_chosen(name)).collect()
}

#[test]
#[ignore = "takes minutes: cargo test --release -p lacuna-plugins --lib -- --ignored --nocapture many_inputs"]
fn many_inputs() {
    let cases: [(Function, &[usize]); 6] = [
        (borehole(), &[100, 300]),
        (welch(), &[100, 200, 500]),
        (morris(), &[200, 500]),
        (diffusion(50), &[100, 200, 500]),
        (diffusion(100), &[100, 200, 500]),
        (uqlab(), &[100, 200, 500]),
    ];
    let wanted = std::env::var("FUNCTIONS").unwrap_or_default();
    println!("function, runs: relative error at 2000 new points (stated error; seconds), of two designs");
    for (function, sizes) in &cases {
        if !function.name.contains(&wanted) {
            continue;
        }
        let parameters = parameters(&function.designs);
        let placed = |count: usize, stream: &Stream| {
            let cube =
                LatinHypercube::default().points(count, parameters.len(), stream).unwrap();
            Matrix::from_fn(count, parameters.len(), |i, j| {
                parameters[j].design.quantile(cube[(i, j)])
            })
        };
        let fresh = super::drawn(&parameters, 2000, &Stream::root(99));
        let truth = values(&fresh, &function.value);
        for &runs in *sizes {
            for (name, surrogate) in surrogates() {
                let mut line = format!("{}, {runs}, {name}:", function.name);
                for seed in [1, 2] {
                    let points = placed(runs, &Stream::root(seed));
                    let responses = values(&points, &function.value);
                    let start = Instant::now();
                    match fitted(&*surrogate, &parameters, &points, &responses) {
                        Ok(emulator) => {
                            let seconds = start.elapsed().as_secs_f64();
                            let error = share(&emulator.mean(&fresh), &truth);
                            let stated = emulator.fit_error().relative[0];
                            line += &format!("  {error:.2e} ({stated:.2e}; {seconds:.2})");
                        }
                        Err(stop) => line += &format!("  {stop}"),
                    }
                }
                println!("{line}");
            }
        }
    }
}
