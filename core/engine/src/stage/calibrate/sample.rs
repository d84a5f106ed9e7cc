//! Draws of one posterior: starting points, the steps of the sampler, and what they show.

use std::path::Path;

use lacuna::data::Draws;
use lacuna::diagnose::Diagnosis;
use lacuna::math::random::Stream;
use lacuna::plugin::sampler::Start;
use lacuna::plugin::{Sampler, Target};
use lacuna::run::{Progress, Stop};
use lacuna_linalg::Matrix;

use super::estimated::{Estimated, LikelihoodEstimate};
use super::slopes::contradiction;
use super::{Calibrated, Coordinate, Outcome, Outline, near, population};
use crate::posterior::Posterior;
use crate::stage::sampling::{self, Length, Sampled};
use crate::stage::start::{inside, maxima, sobol};
use crate::study::Study;

/// A posterior that is to be sampled.
pub(super) struct Asked<'a> {
    pub study: &'a Study,
    pub posterior: &'a Posterior<'a>,
    /// Values at which the search for the best fit begins, one per parameter of the posterior.
    pub stated: Vec<Option<f64>>,
    pub random: Stream,
    /// True if half of the steps suffice.
    pub quick: bool,
}

/// Samples a posterior, with checkpoints in a folder.
pub(super) fn sample(
    asked: &Asked<'_>,
    folder: &Path,
    progress: &Progress<'_>,
) -> Result<Calibrated, Stop> {
    let (study, posterior, random) = (asked.study, asked.posterior, &asked.random);
    let section = study.sampler.as_ref().ok_or_else(|| Stop::new("the study has no sampler"))?;
    let search = random.named("optimise");
    let estimated = posterior.runs().map(|_| Estimated::search(posterior, &search)).transpose()?;
    let mut maxima = if let Some(estimated) = &estimated {
        vec![estimated.maximum()?]
    } else {
        if !asked.quick
            && gives_slopes(study)
            && let Some(text) =
                contradiction(posterior, &coordinates(posterior), &random.named("slopes"))
        {
            progress.warn(&text);
        }
        let maxima = maxima(posterior, &asked.stated, &search);
        sampling::broken(posterior)?;
        maxima?
    };
    let adapted = population::adapted(posterior, &mut maxima)?;
    let posterior = adapted.as_ref().unwrap_or(posterior);
    let target: &dyn Target = match &estimated {
        Some(estimated) => estimated,
        None => posterior,
    };
    let best = &maxima[0];
    let plan = section.built.plugin.plan(posterior.dimension());
    let sampler = &*section.built.plugin;
    let chosen = section.common.start;
    let start = || starts((posterior, target), sampler, chosen, &best.point, random);
    let coordinates = coordinates(posterior);
    let length = Length {
        burn_in: section.common.burn_in.get(),
        stop: section.common.stop.as_ref(),
        half: asked.quick,
    };
    if !asked.quick {
        Outline::of(posterior, &coordinates, sampler, length.burn_in).write(folder)?;
    }
    let mut sampled = sampling::sample(
        &*section.built.plugin,
        target,
        length,
        start,
        &random.named("sample"),
        folder,
        progress,
    )?;
    sampled.draws.names = coordinates.iter().map(|c| c.name.clone()).collect();
    let other_maxima = maxima[1..]
        .iter()
        .filter(|m| best.value - m.value < 10.0)
        .map(|m| (posterior.natural(&m.point), m.value))
        .collect();
    let best_draw = best_draw(posterior, &sampled);
    let draws = natural(posterior, sampled.draws);
    let kept = draws.from_step(sampled.burn_in);
    let diagnosis = if let Some(harvest) = &sampled.harvest {
        Diagnosis::of_harvest(&kept, harvest.effective_size, &harvest.doubts)
    } else {
        let sampler = &section.built.plugin;
        let (doubts, notes) = (sampler.doubts(&sampled.state), sampler.notes(&sampled.state));
        Diagnosis::of(&kept, plan.ensemble).with_notes(notes).with_doubts(doubts)
    };
    let estimate =
        estimated.as_ref().map(|own| own.judge(&kept, sampled.harvest.is_none())).transpose()?;
    let (harvested, evidence) =
        sampled.harvest.map_or_else(Default::default, |h| (h.facts, h.evidence));
    let mut evidence = evidence.or_else(|| section.built.plugin.evidence(&sampled.state));
    if let Some(evidence) = &mut evidence {
        let (log, error) = posterior.log_share();
        evidence.log += log;
        evidence.error = evidence.error.hypot(error).hypot(posterior.prior().log_error());
    }
    let outcome = Outcome {
        coordinates,
        map: posterior.natural(&best.point),
        map_log_density: best.value,
        other_maxima,
        best_draw,
        burn_in: sampled.burn_in,
        acceptance: sampled.acceptance,
        diagnosis,
        evaluations: sampled.state.evaluations,
        facts: [
            posterior.facts(),
            estimate.iter().flat_map(LikelihoodEstimate::facts).collect(),
            section.built.plugin.facts(),
            harvested,
        ]
        .concat(),
        evidence,
        estimate,
        cut: None,
        populations: population::outcomes(study, posterior, &kept),
    };
    Ok(Calibrated { draws, statistics: sampled.statistics, outcome })
}

/// True for a study whose model or surrogate gives derivatives of its own: differences need no look at differences, which
/// would be runs of the model.
fn gives_slopes(study: &Study) -> bool {
    let of_model = || study.model.as_ref().is_none_or(|m| m.built.plugin.gradient().is_some());
    study.surrogate.is_some() || of_model()
}

/// Starting points, one per chain.
fn starts(
    (posterior, target): (&Posterior<'_>, &dyn Target),
    sampler: &dyn Sampler,
    wanted: Option<Start>,
    best: &[f64],
    random: &Stream,
) -> Result<Matrix, Stop> {
    let chains = sampler.plan(posterior.dimension()).chains;
    let random = random.named("start");
    // A method that draws its own starting points needs only the right number of points, whatever their density.
    if !sampler.uses_starts() {
        return Ok(posterior.prior_draws(chains, &random));
    }
    match wanted.unwrap_or_else(|| sampler.start_where()) {
        Start::Prior => inside(posterior, chains, |piece| {
            let more = random.named("more").at(piece as u64);
            Ok(posterior.prior_draws(4 * chains, if piece == 0 { &random } else { &more }))
        }),
        Start::Sobol => {
            inside(posterior, chains, |piece| sobol(posterior, 4 * chains * piece, 4 * chains))
        }
        Start::Map if !posterior.centred().is_empty() => {
            near::around(posterior, best, |near, best| around(near, best, chains, &random))
        }
        Start::Map => around(target, best, chains, &random),
    }
}

/// Starting points around a maximum.
fn around(
    target: &dyn Target,
    best: &[f64],
    chains: usize,
    random: &Stream,
) -> Result<Matrix, Stop> {
    match lacuna_optimise::laplace(target, best) {
        Ok(laplace) => lacuna_optimise::scatter(target, best, &laplace, chains, random),
        Err(_) => lacuna_optimise::scatter_without_bounds(target, best, chains, random),
    }
}

pub(super) fn coordinates(posterior: &Posterior<'_>) -> Vec<Coordinate> {
    let parameters = posterior.parameters().iter().map(|p| Coordinate {
        name: p.name.clone(),
        symbol: p.symbol.clone(),
        unit: p.unit.clone(),
        prior: Some(p.prior.clone()),
        reference: p.reference,
    });
    let hyper = posterior.hyperparameters().iter().map(|h| Coordinate {
        name: h.name.clone(),
        symbol: h.symbol.clone(),
        unit: h.unit.clone(),
        prior: Some(h.prior.clone()),
        reference: None,
    });
    parameters.chain(hyper).collect()
}

fn best_draw(posterior: &Posterior<'_>, sampled: &Sampled) -> (Vec<f64>, f64) {
    let draws = &sampled.draws;
    let Some((chain, step)) = draws.best() else { return (Vec::new(), f64::NEG_INFINITY) };
    let point = draws.point(chain, step);
    let row = Matrix::from_vec(1, point.len(), point.to_vec());
    (posterior.natural(point), posterior.mode().log_density(&row)[0])
}

fn natural(posterior: &Posterior<'_>, mut draws: Draws) -> Draws {
    let d = draws.dimension();
    for point in draws.values.chunks_exact_mut(d) {
        let values = posterior.natural(point);
        point.copy_from_slice(&values);
    }
    draws
}
