//! The part of the gap that the effects leave: its size and its place.

use std::collections::BTreeMap;

use lacuna::plugin::effect::On;
use rustdct::DctPlanner;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::gap::candidates::place;
use crate::gap::experiment::MeasuredCurve;
use crate::gap::search::SearchResult;

/// The share of what remains that the sensors that are told hold together.
const MOST: f64 = 0.8;

/// The share of what remains that lies below the frequency that is told.
const BELOW: f64 = 0.9;

/// The largest deviation of steps from their mean, relative to it, up to which a curve has frequencies.
const EVEN: f64 = 1e-3;

/// The part of the gap that the effects leave.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Remains {
    /// Share of the first gap that remains.
    pub share: f64,
    /// Logarithm of the Bayes factor of a free-form remainder against none, beside the effects.
    pub log_bayes_factor: f64,
    /// Root mean square of what remains, in standard deviations of one replicate's noise.
    pub rms: f64,
    /// Places that together hold most of it, the largest first, by axis.
    pub sensors: Vec<On>,
    /// Frequency below which nine tenths of it lie, in the inverse unit of the last axis.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub below: Option<f64>,
}

/// The part of the gap that the effects of a search leave; `None` if nothing shows.
pub(super) fn remains(found: &SearchResult<'_>) -> Option<Remains> {
    let last = &found.last.tolerant;
    let setting = last.setting?;
    let experiment = found.system.experiment;
    let left = found.remainder.estimate(&found.whitener, &found.last.fit, setting);
    let sd = found.noise.sd(experiment, &found.last.fit.at.response);
    let square = |i: usize| (left[i] / sd[i].max(f64::MIN_POSITIVE)).powi(2);
    let (mut by_sensor, mut count) = (BTreeMap::<On, f64>::new(), 0.0);
    for curve in &experiment.curves {
        *by_sensor.entry(place(curve)).or_default() +=
            curve.measured.iter().map(|&i| square(i)).sum::<f64>();
        count += curve.measured.len() as f64;
    }
    let all: f64 = by_sensor.values().sum();
    let whole = found.explained.total();
    Some(Remains {
        share: if whole > 0.0 { found.explained.left / whole } else { 1.0 },
        log_bayes_factor: last.inexact,
        rms: (all / f64::max(count, 1.0)).sqrt(),
        sensors: largest(by_sensor, all),
        below: below(&experiment.curves, &left),
    })
}

/// The sensors that together hold most of the sum.
fn largest(by_sensor: BTreeMap<On, f64>, all: f64) -> Vec<On> {
    let mut sorted: Vec<(On, f64)> = by_sensor.into_iter().collect();
    sorted.sort_by(|a, b| b.1.total_cmp(&a.1));
    let mut sum = 0.0;
    let told = sorted.into_iter().take_while(|(_, own)| {
        let more = sum < MOST * all;
        sum += own;
        more
    });
    told.map(|(on, _)| on).filter(|on| !on.is_empty()).collect()
}

/// The frequency below which most of the curves' squares lie; `None` if their steps are not even or differ.
fn below(curves: &[MeasuredCurve], left: &[f64]) -> Option<f64> {
    let measured: Vec<&MeasuredCurve> = curves.iter().filter(|c| c.measured.len() > 3).collect();
    let (length, step) = measured.first().and_then(|curve| even(&curve.at))?;
    let alike = |curve: &&MeasuredCurve| {
        even(&curve.at).is_some_and(|(n, h)| n == length && (h - step).abs() <= EVEN * step)
    };
    if !measured.iter().all(alike) {
        return None;
    }
    let cosines = DctPlanner::new().plan_dct2(length);
    let mut power = vec![0.0; length];
    for curve in measured {
        let mut own: Vec<f64> = curve.measured.iter().map(|&i| left[i]).collect();
        cosines.process_dct2(&mut own);
        power.iter_mut().zip(own).for_each(|(p, c)| *p += c * c);
    }
    // Cosine k of a curve of n even steps has the frequency k / (2 n step).
    power[0] *= 0.5;
    let all: f64 = power.iter().sum();
    let mut sum = 0.0;
    let k = power.iter().position(|p| {
        sum += p;
        sum >= BELOW * all
    })?;
    Some((k + 1) as f64 / (2.0 * length as f64 * step))
}

/// The number of places and their step, if they are even.
fn even(at: &[f64]) -> Option<(usize, f64)> {
    let step = (at[at.len() - 1] - at[0]) / (at.len() - 1) as f64;
    let is_even = at.windows(2).all(|two| ((two[1] - two[0]) - step).abs() <= EVEN * step);
    (step > 0.0 && is_even).then_some((at.len(), step))
}
