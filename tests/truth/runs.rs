//! Complete runs of a sampler on a density, as in a study: starts scattered around the best maximum.

use lacuna::data::Draws;
use lacuna::diagnose::{autocorrelation, chains};
use lacuna::math::moments::{mean, variance};
use lacuna::math::random::Stream;
use lacuna::plugin::sampler::Harvest;
use lacuna::plugin::{Sampler, Target, registry};
use lacuna_linalg::Matrix;

/// Returns true if every sampler is to run on everything, which is too long for each change (`.ci/full`).
pub fn every_one() -> bool {
    std::env::var_os("LACUNA_TRUTH").is_some()
}

/// Draws of one run.
pub struct Run {
    /// Draws after burn-in and warm-up; a single chain for a harvest.
    pub draws: Draws,
    /// True if the chains are walkers of one ensemble.
    pub ensemble: bool,
    /// The harvest, for methods whose steps are not draws.
    pub harvest: Option<Harvest>,
}

/// A sampler from its options as a study writes them.
pub fn sampler(name: &str, options: &str) -> Box<dyn Sampler> {
    registry::from_text::<dyn Sampler>(name, options)
        .unwrap_or_else(|e| panic!("{name}: {e}"))
        .plugin
}

/// Starting points around the largest maximum reached from draws of the prior.
pub fn starts(target: &dyn Target, chains: usize, stream: &Stream) -> Matrix {
    let candidates = target.prior_draws(200, &stream.named("candidates"));
    let density = target.log_density(&candidates);
    let mut order: Vec<usize> = (0..200).filter(|&i| density[i].is_finite()).collect();
    order.sort_by(|&a, &b| density[b].total_cmp(&density[a]));
    order.truncate(6);
    let maxima = lacuna_optimise::maximise(target, &candidates.select_rows(&order));
    let shape = lacuna_optimise::laplace(target, &maxima[0].point).unwrap();
    lacuna_optimise::scatter(target, &maxima[0].point, &shape, chains, &stream.named("start"))
        .unwrap()
}

/// Runs all steps; the first quarter, and at least the warm-up, is dropped.
pub fn run(sampler: &dyn Sampler, target: &dyn Target, stream: &Stream) -> Run {
    let plan = sampler.plan(target.dimension());
    let points = starts(target, plan.chains, stream);
    run_from(sampler, target, points, stream)
}

/// Like [`run`], from given points.
pub fn run_from(
    sampler: &dyn Sampler,
    target: &dyn Target,
    points: Matrix,
    stream: &Stream,
) -> Run {
    let plan = sampler.plan(target.dimension());
    let first = plan.warm_up.max(plan.steps / 4);
    let mut state = sampler.start(target, points).unwrap_or_else(|stop| panic!("{stop}"));
    let mut kept = Vec::new();
    for step in 0..plan.steps {
        if sampler.finished(&state) {
            break;
        }
        sampler.step(target, &mut state, &stream.named("step").at(step as u64)).unwrap();
        if step >= first {
            kept.push((state.points.clone(), state.log_density.clone()));
        }
    }
    let names = (0..target.dimension()).map(|j| format!("x{j}")).collect();
    let harvest = sampler.harvest(target, &state, &stream.named("harvest")).unwrap();
    let draws = match &harvest {
        Some(harvest) => Draws {
            names,
            chains: 1,
            steps: harvest.points.rows(),
            values: harvest.points.as_slice().to_vec(),
            log_density: harvest.log_density.clone(),
        },
        None => Draws::from_steps(names, &kept),
    };
    Run { draws, ensemble: plan.ensemble, harvest }
}

/// An estimate with its Monte Carlo standard error.
#[derive(Debug, Clone, Copy)]
pub struct Estimate {
    pub value: f64,
    pub error: f64,
}

impl Run {
    /// Mean and standard deviation of a function of the point.
    pub fn moments(&self, function: impl Fn(&[f64]) -> f64) -> (Estimate, Estimate) {
        let d = self.draws.dimension();
        let values: Vec<Vec<f64>> = (0..self.draws.chains)
            .map(|c| (0..self.draws.steps).map(|s| function(self.draws.point(c, s))).collect())
            .collect();
        assert!(d > 0);
        let pooled = values.concat();
        let (centre, spread) = (mean(&pooled), variance(&pooled));
        let squares: Vec<Vec<f64>> =
            values.iter().map(|c| c.iter().map(|x| (x - centre).powi(2)).collect()).collect();
        let sd = spread.sqrt();
        let of_mean = self.error(&values);
        // The delta method converts the error of the variance into that of the standard deviation.
        let of_sd = self.error(&squares) / (2.0 * sd);
        (Estimate { value: centre, error: of_mean }, Estimate { value: sd, error: of_sd })
    }

    /// The Monte Carlo standard error of a mean.
    fn error(&self, values: &[Vec<f64>]) -> f64 {
        match &self.harvest {
            Some(harvest) => (variance(&values.concat()) / harvest.effective_size).sqrt(),
            None if self.ensemble => {
                autocorrelation::ensemble_error(values).max(chains::mcse_mean(values))
            }
            None => chains::mcse_mean(values),
        }
    }
}
