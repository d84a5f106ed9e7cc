//! Every sampler on the posteriors of posteriordb.
//!
//! A sampler passes if the mean and the standard deviation of every published quantity agree with the reference draws
//! within three Monte Carlo errors of both combined. Of a few hundred quantities some fail by chance: they are repeated
//! once with other random numbers, where all must agree.
//!
//! Each change runs every sampler on some posteriors, the hardest among them; the whole list for each takes some minutes:
//!
//! ```sh
//! LACUNA_TRUTH=1 cargo test --release --workspace --test all -- truth::
//! ```

use lacuna::math::moments::{mean, variance};
use lacuna::math::random::Stream;
use lacuna_engine::posterior::{Given, Posterior};
use lacuna_linalg::Matrix;
use posteriordb::Reference;

use super::runs::{self, Estimate, Run};

/// Regressions, time series and hierarchical models: twelve posteriors of three to ten unknowns.
const PLAIN: [&str; 12] = [
    "arK-arK",
    "eight_schools-eight_schools_noncentered",
    "garch-garch11",
    "gp_pois_regr-gp_regr",
    "kidiq-kidscore_interaction",
    "kidiq-kidscore_momhsiq",
    "kilpisjarvi_mod-kilpisjarvi",
    "low_dim_gauss_mix-low_dim_gauss_mix",
    "mesquite-logmesquite_logvash",
    "nes1980-nes",
    "sblrc-blr",
    "sblri-blr",
];

/// Half of them, for random walks.
const HALF: [&str; 6] = [
    "arK-arK",
    "eight_schools-eight_schools_noncentered",
    "garch-garch11",
    "kidiq-kidscore_momhsiq",
    "low_dim_gauss_mix-low_dim_gauss_mix",
    "nes1980-nes",
];

/// A quarter of them, a hierarchy, a time series and a mixture, for samplers that take longer.
const QUARTER: [&str; 3] = [
    "eight_schools-eight_schools_noncentered",
    "garch-garch11",
    "low_dim_gauss_mix-low_dim_gauss_mix",
];

/// Published quantities with which one run disagrees, as text.
fn disagreements(
    posterior: &posteriordb::Posterior,
    sampler: (&str, &str),
    stream: &Stream,
) -> Vec<String> {
    let bound = posterior.density.bind(&posterior.parameters).unwrap();
    let given = Given::posterior(&*bound, (&posterior.parameters).into());
    let target = Posterior::new(&posterior.parameters, given);
    let run = runs::run(&*runs::sampler(sampler.0, sampler.1), &target, stream);
    if run.harvest.as_ref().is_some_and(|harvest| !harvest.doubts.is_empty()) {
        // A method that itself reports its draws as unreliable makes no claim.
        return Vec::new();
    }
    posterior
        .reference
        .iter()
        .enumerate()
        .filter_map(|(k, reference)| {
            let (mean, sd) = run.moments(|point| (posterior.reported)(point)[k]);
            let tails = kurtosis(&run, |point| (posterior.reported)(point)[k]);
            judge(reference, mean, sd, tails)
        })
        .collect()
}

/// Kurtosis: fourth moment over the squared variance.
fn kurtosis(run: &Run, function: impl Fn(&[f64]) -> f64) -> f64 {
    let points: Matrix = run.draws.points();
    let values: Vec<f64> = points.iter_rows().map(function).collect();
    let centre = mean(&values);
    let fourth: Vec<f64> = values.iter().map(|x| (x - centre).powi(4)).collect();
    mean(&fourth) / variance(&values).powi(2)
}

fn judge(reference: &Reference, mean: Estimate, sd: Estimate, tails: f64) -> Option<String> {
    // The effective sample size of the reference follows from the published error of its mean; the delta method gives
    // the error of its standard deviation.
    let draws = (reference.sd / reference.mean_error).powi(2);
    let sd_error = 0.5 * reference.sd * ((tails - 1.0).max(2.0) / draws).sqrt();
    let apart = |found: Estimate, value: f64, error: f64| {
        let errors = (found.value - value).abs() / found.error.hypot(error);
        (errors.is_nan() || errors > 3.0).then_some(errors)
    };
    let name = &reference.name;
    let of_mean = apart(mean, reference.mean, reference.mean_error)
        .map(|n| format!("{name}: mean {} is not {} ({n:.1} errors)", mean.value, reference.mean));
    let of_sd = apart(sd, reference.sd, sd_error)
        .map(|n| format!("{name}: sd {} is not {} ({n:.1} errors)", sd.value, reference.sd));
    of_mean.into_iter().chain(of_sd).reduce(|a, b| format!("{a}; {b}"))
}

/// Runs a sampler on these posteriors, or on all of them if they are asked for.
fn all(names: &[&str], sampler: (&str, &str)) {
    let names = if runs::every_one() { &PLAIN[..] } else { names };
    let mut failed = Vec::new();
    for posterior in posteriordb::posteriors().iter().filter(|p| names.contains(&p.name)) {
        let stream = Stream::root(28).named(posterior.name);
        if disagreements(posterior, sampler, &stream.named("first")).is_empty() {
            continue;
        }
        let second = disagreements(posterior, sampler, &stream.named("second"));
        if !second.is_empty() {
            failed.push(format!("{}: {}", posterior.name, second.join("; ")));
        }
    }
    assert!(failed.is_empty(), "{}: {}", sampler.0, failed.join("\n"));
}

#[test]
fn no_u_turn() {
    all(&QUARTER, ("no_u_turn", ""));
}

#[test]
fn hamiltonian() {
    all(&QUARTER, ("hamiltonian", "warm_up = 500\nsteps = 1200"));
}

#[test]
fn affine_invariant_ensemble() {
    all(&QUARTER, ("affine_invariant_ensemble", "walkers = 60\nsteps = 4000"));
}

#[test]
fn metropolis() {
    all(&HALF, ("metropolis", "steps = 20000"));
}

#[test]
fn adaptive_metropolis() {
    all(&HALF, ("adaptive_metropolis", "steps = 20000"));
}

#[test]
fn delayed_rejection_adaptive_metropolis() {
    all(&HALF, ("delayed_rejection_adaptive_metropolis", "steps = 20000"));
}

#[test]
fn differential_evolution() {
    all(&HALF, ("differential_evolution", "steps = 20000"));
}

#[test]
fn sequential_monte_carlo() {
    all(&QUARTER, ("sequential_monte_carlo", "particles = 2000"));
}

#[test]
fn nested() {
    all(&QUARTER, ("nested", ""));
}

#[test]
fn variational() {
    all(&PLAIN, ("variational", ""));
}

/// Every target fulfils the contract and has its published quantities.
#[test]
fn the_posteriors_are_sound() {
    let all = posteriordb::posteriors();
    assert_eq!(all.len(), 15);
    for posterior in &all {
        let breaches =
            lacuna_contract::density(posterior.name, &*posterior.density, &posterior.parameters);
        assert_eq!(breaches, Ok(()));
        let middle: Vec<f64> = posterior.parameters.iter().map(|p| p.prior.quantile(0.5)).collect();
        assert!(posterior.reference.iter().all(|r| r.mean_error > 0.0 && r.mean_error < r.sd));
        let names: Vec<&str> = posterior.reference.iter().map(|r| r.name.as_str()).collect();
        assert_eq!(
            (posterior.reported)(&middle).len(),
            names.len(),
            "{}: {names:?}",
            posterior.name
        );
    }
}

/// At the published means the density is much larger than ten standard deviations to either side in any coordinate.
#[test]
fn the_published_means_have_a_high_density() {
    for posterior in posteriordb::posteriors() {
        if posterior.name.starts_with("eight_schools") {
            continue;
        }
        let bound = posterior.density.bind(&posterior.parameters).unwrap();
        let mean: Vec<f64> = posterior.reference.iter().map(|r| r.mean).collect();
        let at = bound.gradient(&mean).0;
        assert!(at.is_finite(), "{}", posterior.name);
        for (j, figures) in posterior.reference.iter().enumerate() {
            for side in [-10.0, 10.0] {
                let mut moved = mean.clone();
                moved[j] += side * figures.sd;
                let away = bound.gradient(&moved).0;
                assert!(away < at - 1.0, "{}, {}: {away} and {at}", posterior.name, figures.name);
            }
        }
    }
}
