//! The origin of the noise of single records in words, with its size and its memory.

use lacuna::data::Coordinates;

use super::{CurveNoise, Noise, Origin};
use crate::gap::experiment::{Experiment, MeasuredCurve};
use crate::page::number::significant;

/// Digits of a size or a memory in words.
const DIGITS: usize = 2;

/// The number of steps below which noise counts as white in words.
const WHITE: f64 = 1.0;

impl CurveNoise {
    /// The distance along a curve over which the correlation of the noise falls to `1/e`, in the unit of the last axis,
    /// interpolated between lags; the curve's length if it does not fall so far.
    pub fn correlation_time(&self, curve: &MeasuredCurve) -> f64 {
        let covariances = self.memory.autocovariances(curve.measured.len().max(2));
        let correlation = |lag: usize| covariances[lag] / covariances[0];
        let level = (-1.0_f64).exp();
        let after = (1..covariances.len()).find(|&lag| correlation(lag) < level);
        let lags = after.map_or(covariances.len() as f64, |lag| {
            let (above, below) = (correlation(lag - 1), correlation(lag));
            (lag - 1) as f64 + (above - level) / (above - below)
        });
        lags * curve.step()
    }

    /// The standard deviation of a single value, root mean square along its curve, in the response's unit.
    pub fn size(&self) -> f64 {
        let squares: f64 = self.profile.iter().map(|w| w * w).sum();
        let mean = (squares / self.profile.len().max(1) as f64).sqrt();
        self.sd * mean * self.memory.variance().sqrt()
    }
}

impl Noise {
    /// The origin of the noise of curves without replicates: what was assumed, with the figures of the noisiest curve,
    /// or what the study states; `None` if replicates show all noise.
    pub fn provenance(&self, experiment: &Experiment<'_>) -> Option<String> {
        let assumed = |s: &usize| matches!(self.origins[*s], Origin::Record | Origin::StatedInPart);
        let measured = |s: &usize| !experiment.curves[*s].measured.is_empty();
        let all = (0..self.curves.len()).filter(|s| assumed(s) && measured(s));
        let noisiest = all.max_by(|&i, &j| {
            self.curves[i].size().total_cmp(&self.curves[j].size()).then(j.cmp(&i))
        });
        let Some(s) = noisiest else {
            let stated = self.origins.contains(&Origin::Stated);
            let by = experiment.stated.as_ref().filter(|_| stated)?.by;
            return Some(format!("noise stated: without replicates, the noise is that of {by}"));
        };
        let curve = &experiment.curves[s];
        let (noise, figures) = (&self.curves[s], Figures::of(experiment, curve));
        let lead = if self.origins[s] == Origin::Record {
            "noise assumed: without replicates, the residual of a single record beside its slow part counts as noise"
        } else {
            "noise assumed in part: without replicates, what the study leaves out is estimated from the single record"
        };
        Some(format!(
            "{lead}; that of {} was taken for noise with {} and sd {}; if your instrument is better, state it: `noise = \
             {{ sd = ..., memory = ... }}` in `[measurements]`",
            figures.name,
            figures.memory(noise.correlation_time(curve), curve.step()),
            figures.size(noise.size()),
        ))
    }
}

/// The name of a curve with the units of its figures.
struct Figures {
    name: String,
    response: String,
    axis: String,
}

impl Figures {
    fn of(experiment: &Experiment<'_>, curve: &MeasuredCurve) -> Self {
        let found = curve.measured.first().and_then(|&i| {
            experiment.layouts.parts().find(|(_, range)| range.contains(&i)).map(|(own, _)| own)
        });
        let axis = found.and_then(|layout| match &layout.axes.last()?.coordinates {
            Coordinates::Grid { unit, .. } => Some(with_unit(unit)),
            Coordinates::Labels(_) => None,
        });
        let scenario = experiment.conditions[curve.condition].scenario.as_ref();
        let under = scenario.map(|name| format!(" under {name}")).unwrap_or_default();
        Self {
            name: format!("{}{under}", curve.name(experiment.layouts)),
            response: found.map(|layout| with_unit(&layout.unit)).unwrap_or_default(),
            axis: axis.unwrap_or_default(),
        }
    }

    fn memory(&self, time: f64, step: f64) -> String {
        if time < WHITE * step {
            return "no memory".to_owned();
        }
        format!("a memory of {}{}", significant(time, DIGITS), self.axis)
    }

    fn size(&self, sd: f64) -> String {
        format!("{}{}", significant(sd, DIGITS), self.response)
    }
}

/// A unit after a number; nothing for a plain number.
fn with_unit(unit: &lacuna::data::Unit) -> String {
    if unit.is_dimensionless() { String::new() } else { format!(" {unit}") }
}
