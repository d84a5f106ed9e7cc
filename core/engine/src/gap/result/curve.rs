//! The curves of a result, each with its noise.

use std::ops::Range;

use serde::{Deserialize, Serialize};

use crate::gap::experiment::MeasuredCurve;
use crate::gap::noise::Origin;
use crate::gap::search::SearchResult;

/// A curve with the noise of its replicates.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CurveResult {
    /// The name: its labels in words.
    pub name: String,
    /// The labels by axis, the scenario aside.
    pub labels: Vec<(String, String)>,
    /// The scenario.
    pub scenario: Option<String>,
    /// The outputs.
    pub outputs: Range<usize>,
    /// The indices of the outputs that were measured.
    pub measured: Vec<usize>,
    /// The coordinate of each of them on the last axis, in its unit.
    pub at: Vec<f64>,
    /// The standard deviation of one replicate, root mean square along the curve, in the response's unit.
    pub sd: f64,
    /// The coefficients of the noise's autoregression.
    pub memory: Vec<f64>,
    /// The standard deviations of the random effects of whole replicates: offset in the response's unit, gain, and
    /// shift in the last axis's unit; those of the curve and those that all curves share.
    pub wander: [f64; 3],
    /// The origin of the noise.
    pub origin: Origin,
}

/// The curves of the result of a search.
pub(super) fn all(found: &SearchResult<'_>) -> Vec<CurveResult> {
    let experiment = found.system.experiment;
    let sd = found.noise.sd(experiment, &found.last.fit.at.response);
    let result = |(s, curve): (usize, &MeasuredCurve)| {
        let noise = &found.noise.curves[s];
        let squares: f64 = curve.measured.iter().map(|&i| sd[i] * sd[i]).sum();
        let (own, shared) =
            (noise.wander.variances(), found.noise.shared[curve.condition].variances());
        CurveResult {
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
    experiment.curves.iter().enumerate().map(result).collect()
}
