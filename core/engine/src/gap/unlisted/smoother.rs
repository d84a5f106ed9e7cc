//! The smoother: an orthogonal Gaussian process in place of an unlisted effect.

use std::f64::consts::{PI, TAU};

use serde::{Deserialize, Serialize};

use super::features::Features;
use super::process::{Kernel, Process};
use crate::gap::noise::Noise;
use crate::gap::system::System;
use crate::gap::system::fit::Fit;
use crate::gap::system::whitener::Whitener;
use crate::gap::test::Region;

/// The number of sines of all curves together, limited by the eigenvalue problem of each trial of hyperparameters.
const SINES: usize = 160;

/// The largest number of curves.
const CURVES: usize = 12;

/// The number of lengths of the first grid.
const LENGTHS: usize = 10;

/// A Gaussian process in place of an unlisted effect, over the last axis of the curves of some regions.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Smoother {
    /// The curves, by their index in the experiment.
    pub curves: Vec<SmoothedCurve>,
    /// The correlation length, in the unit of the last axis.
    pub length: f64,
    /// The central frequency, in periods per unit of the last axis; zero for a process that does not oscillate.
    pub frequency: f64,
    /// The posterior mean at every output, in the response's unit; zero outside its curves.
    pub mean: Vec<f64>,
    /// The posterior standard deviation at every output, in the response's unit.
    pub sd: Vec<f64>,
    /// The log Bayes factor against no process, with the hyperparameters of largest evidence.
    pub log_evidence: f64,
    /// The share of the excess misfit that it explains, minus its expectation under noise alone.
    pub explained: f64,
}

/// A curve of a smoother.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SmoothedCurve {
    /// The index in the experiment.
    pub curve: usize,
    /// The prior standard deviation of the process on it, in the response's unit.
    pub amplitude: f64,
}

/// Fits the smoother to the residual on the curves of the regions (at most the first twelve), or on all curves if there
/// are no regions; `excess` is the energy of the residual minus its expectation under noise. `None` if the curves have
/// no axis, or if the process explains nothing.
///
/// Show its mean and its band of 1.96 standard deviations about the calibrated response.
pub fn smooth(
    system: &System<'_>,
    fit: &Fit,
    noise: &Noise,
    whitener: &Whitener,
    regions: &[Region],
    excess: f64,
) -> Option<Smoother> {
    let experiment = system.experiment;
    let mut chosen: Vec<usize> = Vec::new();
    let all = regions.iter().flat_map(|region| region.curves.iter().copied());
    for s in all.chain((0..experiment.curves.len()).filter(|_| regions.is_empty())) {
        let seen = chosen.contains(&s) || experiment.curves[s].measured.is_empty();
        if !seen && chosen.len() < CURVES {
            chosen.push(s);
        }
    }
    let sd = noise.sd(experiment, &fit.at.response);
    let scale = |s: usize| {
        let own = &experiment.curves[s].measured;
        (own.iter().map(|&i| sd[i] * sd[i]).sum::<f64>() / own.len() as f64).sqrt()
    };
    let curves: Vec<(usize, f64)> = chosen.into_iter().map(|s| (s, scale(s))).collect();
    let most = SINES / curves.len().max(1);
    let features = Features::new(experiment, fit, whitener, &curves, most)?;
    let (shape, amplitude, log_evidence) = best(&features)?;
    let process = Process::new(&features, &shape)?;
    let posterior = process.posterior(amplitude);
    let (taken, of_noise) = process.taken(amplitude);
    Some(Smoother {
        curves: curves
            .into_iter()
            .map(|(curve, scale)| SmoothedCurve { curve, amplitude: amplitude * scale })
            .collect(),
        length: shape.length,
        frequency: shape.middle / TAU,
        mean: posterior.mean,
        sd: posterior.sd,
        log_evidence,
        explained: ((taken - of_noise) / excess.max(f64::MIN_POSITIVE)).clamp(0.0, 1.0),
    })
}

/// Hyperparameters with their amplitude and log evidence.
type Trial = Option<(Kernel, f64, f64)>;

/// The hyperparameters of largest marginal likelihood, with its logarithm: on a grid of lengths, then of frequencies,
/// then refined.
fn best(features: &Features) -> Option<(Kernel, f64, f64)> {
    let at = |shape: Kernel| {
        let (amplitude, value) = Process::new(features, &shape)?.best();
        Some((shape, amplitude, value))
    };
    let better = |best: Trial, next: Trial| match (best, next) {
        (Some(best), Some(next)) => Some(if next.2 > best.2 { next } else { best }),
        (best, next) => best.or(next),
    };
    let fastest = features.angular.iter().copied().fold(0.0, f64::max);
    let shortest = (PI / fastest).max(features.step);
    let ratio = (2.0 * features.length / shortest).max(2.0);
    let lengths = (0..LENGTHS)
        .map(|k| shortest * ratio.powf(k as f64 / (LENGTHS - 1) as f64))
        .map(|length| at(Kernel { length, middle: 0.0 }));
    let mut found = lengths.fold(None, better);
    let mut middle = TAU / features.length;
    while middle < fastest {
        for share in [0.5, 0.125] {
            found = better(found, at(Kernel { length: share * features.length, middle }));
        }
        middle *= 1.15;
    }
    for step in [1.15_f64, 1.05, 1.015] {
        for (length, middle) in [(step, 1.0), (1.0 / step, 1.0), (1.0, step), (1.0, 1.0 / step)] {
            let Some((here, _, _)) = found else { continue };
            if here.middle > 0.0 || middle == 1.0 {
                let next = Kernel { length: here.length * length, middle: here.middle * middle };
                found = better(found, at(next));
            }
        }
    }
    found.filter(|(_, amplitude, value)| *amplitude > 0.0 && *value > 0.0)
}
