//! Each curve with its noise.

use std::ops::Range;

use serde::{Deserialize, Serialize};

use crate::gap::experiment::Curve;
use crate::gap::name::Found;
use crate::gap::noise::Origin;

/// A curve with the noise of its replicates.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CurveAccount {
    /// Its name: its labels in words.
    pub name: String,
    /// Its labels by axis, the scenario aside.
    pub labels: Vec<(String, String)>,
    /// The scenario.
    pub scenario: Option<String>,
    /// Its outputs.
    pub outputs: Range<usize>,
    /// The outputs that were measured, and where along the last axis.
    pub measured: Vec<usize>,
    /// See `measured`.
    pub at: Vec<f64>,
    /// The standard deviation of one replicate, root mean square along the curve.
    pub sd: f64,
    /// The coefficients of the noise's autoregression.
    pub memory: Vec<f64>,
    /// The standard deviations of what whole replicates differ by: offset in the response's unit, gain, and clock in the
    /// last axis's unit; its own and shared with other curves.
    pub wander: [f64; 3],
    /// Where the noise is known from.
    pub origin: Origin,
}

/// The curves of what a search found.
pub(super) fn all(found: &Found<'_>) -> Vec<CurveAccount> {
    let experiment = found.system.experiment;
    let sd = found.noise.sd(experiment, &found.last.fit.at.response);
    let account = |(s, curve): (usize, &Curve)| {
        let noise = &found.noise.curves[s];
        let squares: f64 = curve.measured.iter().map(|&i| sd[i] * sd[i]).sum();
        let (own, shared) =
            (noise.wander.variances(), found.noise.shared[curve.condition].variances());
        CurveAccount {
            name: curve.name(experiment.layouts),
            labels: curve.labels.clone(),
            scenario: experiment.conditions[curve.condition].scenario.clone(),
            outputs: curve.outputs.clone(),
            measured: curve.measured.clone(),
            at: curve.at.clone(),
            sd: (squares / curve.measured.len().max(1) as f64).sqrt(),
            memory: noise.memory.coefficients().to_vec(),
            wander: [0, 1, 2].map(|d| (own[d] + shared[d]).sqrt()),
            origin: found.noise.origins[s],
        }
    };
    experiment.curves.iter().enumerate().map(account).collect()
}
