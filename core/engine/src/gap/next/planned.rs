//! Planned measurements: an experiment of the curves that are measured next, with the noise that they will have.

use lacuna::data::Coordinates;
use lacuna::plugin::effect::On;
use lacuna::text::values::Interval;
use lacuna_linalg::{Cholesky, Matrix, multiply_transposed};

use super::without_errors;
use crate::gap::candidates::place;
use crate::gap::experiment::{Condition, Experiment, MeasuredCurve};
use crate::gap::noise::{CurveNoise, Noise, Origin, ReplicateVariation};
use crate::study::gap::next::NextKeys;

/// The coordinate of each output on the last axis; `None` if it has no grid.
pub(super) struct Grid(Vec<Option<f64>>);

impl Grid {
    /// The grid of an experiment.
    pub fn of(experiment: &Experiment<'_>) -> Self {
        let one = |layout: &lacuna::data::Layout| -> Vec<Option<f64>> {
            match layout.axes.last().map(|axis| &axis.coordinates) {
                Some(Coordinates::Grid { values, .. }) => {
                    (0..layout.len()).map(|i| Some(values[i % values.len()])).collect()
                }
                _ => vec![None; layout.len()],
            }
        };
        Self(experiment.layouts.parts().flat_map(|(layout, _)| one(layout)).collect())
    }

    /// Returns true if an output lies in one of the intervals, or if there are no intervals.
    pub fn is_along(&self, output: usize, along: &[Interval]) -> bool {
        let inside = |x: f64| along.iter().any(|interval| interval.contains(x));
        along.is_empty() || self.0[output].is_some_and(inside)
    }

    fn at(&self, output: usize) -> f64 {
        self.0[output].unwrap_or(0.0)
    }
}

/// Returns true if a curve has the labels of a place.
pub(super) fn is_on(curve: &MeasuredCurve, on: &On) -> bool {
    on.iter().all(|(axis, labels)| {
        curve.labels.iter().any(|(own, label)| own == axis && labels.contains(label))
    })
}

/// The outputs of each curve that an option measures; empty for curves that it does not.
pub(super) fn chosen(experiment: &Experiment<'_>, keys: &NextKeys) -> Vec<Vec<usize>> {
    let grid = Grid::of(experiment);
    let has_data = |c: usize| {
        experiment.curves[experiment.conditions[c].curves.clone()]
            .iter()
            .any(|curve| !curve.measured.is_empty())
    };
    let in_scenario = |c: usize| match &experiment.conditions[c].scenario {
        Some(name) if !keys.scenarios.is_empty() => keys.scenarios.contains(name),
        _ => has_data(c),
    };
    let is_measured_sensor = |own: &MeasuredCurve| {
        experiment.curves.iter().any(|c| c.labels == own.labels && !c.measured.is_empty())
    };
    let one = |curve: &MeasuredCurve| -> Vec<usize> {
        let at_sensor =
            if keys.on.is_empty() { is_measured_sensor(curve) } else { is_on(curve, &keys.on) };
        if !in_scenario(curve.condition) || !at_sensor {
            return Vec::new();
        }
        let inside = |i: &usize| grid.is_along(*i, &keys.along);
        let measured: Vec<usize> = curve.measured.iter().copied().filter(inside).collect();
        if measured.is_empty() && (curve.measured.is_empty() || !keys.along.is_empty()) {
            return curve.outputs.clone().filter(inside).collect();
        }
        measured
    };
    experiment.curves.iter().map(one).collect()
}

/// An experiment with the chosen outputs of each curve, without known errors, and its noise; `sd` is that of a single
/// value, if it is stated.
pub(super) fn planned<'a>(
    experiment: &Experiment<'a>,
    noise: &Noise,
    chosen: &[Vec<usize>],
    sd: Option<f64>,
) -> (Experiment<'a>, Noise) {
    let grid = Grid::of(experiment);
    let (mut conditions, mut curves) = (Vec::new(), Vec::new());
    let mut own = Noise {
        curves: Vec::new(),
        shared: noise.shared.clone(),
        across: Vec::new(),
        origins: Vec::new(),
    };
    for (c, condition) in experiment.conditions.iter().enumerate() {
        let begin = curves.len();
        let kept: Vec<usize> =
            condition.curves.clone().filter(|&s| !chosen[s].is_empty()).collect();
        for &s in &kept {
            let outputs = &chosen[s];
            own.curves.push(noise_of(experiment, noise, s, outputs, sd));
            own.origins.push(Origin::Stated);
            curves.push(MeasuredCurve {
                measured: outputs.clone(),
                at: outputs.iter().map(|&i| grid.at(i)).collect(),
                ..experiment.curves[s].clone()
            });
        }
        own.across.push(correlation(noise.across[c].as_ref(), condition, &kept, chosen));
        conditions.push(Condition { curves: begin..curves.len(), ..condition.clone() });
    }
    (Experiment { conditions, curves, ..without_errors(experiment) }, own)
}

/// The factor of the correlation between the curves that are kept; `None` if they are independent, or if their lengths
/// differ.
fn correlation(
    factor: Option<&Matrix>,
    condition: &Condition,
    kept: &[usize],
    chosen: &[Vec<usize>],
) -> Option<Matrix> {
    let rows: Vec<usize> = kept.iter().map(|s| s - condition.curves.start).collect();
    let is_even = kept.windows(2).all(|pair| chosen[pair[0]].len() == chosen[pair[1]].len());
    if rows.len() < 2 || !is_even {
        return None;
    }
    let factor = factor?;
    let own = Matrix::from_fn(rows.len(), factor.columns(), |i, j| factor[(rows[i], j)]);
    Some(Cholesky::new(&multiply_transposed(&own, &own)).ok()?.lower().clone())
}

/// The noise of some outputs of a curve: its own, or else that of the same sensor in another condition, or else as the
/// study states it, or else the mean of all curves. `sd` is that of a single value, if it is stated for the option.
fn noise_of(
    experiment: &Experiment<'_>,
    noise: &Noise,
    s: usize,
    outputs: &[usize],
    sd: Option<f64>,
) -> CurveNoise {
    let curve = &experiment.curves[s];
    let is_measured = |t: &usize| !experiment.curves[*t].measured.is_empty();
    let all = || (0..experiment.curves.len()).filter(is_measured);
    let same = |t: &usize| place(&experiment.curves[*t]) == place(curve);
    let flat = |law: &CurveNoise| CurveNoise { profile: vec![1.0; outputs.len()], ..law.clone() };
    let mut own = if is_measured(&s) {
        let law = &noise.curves[s];
        CurveNoise { profile: nearest(&curve.measured, &law.profile, outputs), ..law.clone() }
    } else if let Some(t) = all().find(same) {
        flat(&noise.curves[t])
    } else {
        let laws: Vec<&CurveNoise> = all().map(|t| &noise.curves[t]).collect();
        let square = |law: &&CurveNoise| law.sd * law.sd * law.memory.variance();
        let mean = laws.iter().map(square).sum::<f64>() / laws.len().max(1) as f64;
        let law = laws.first().map_or_else(white, |law| (*law).clone());
        let stated = experiment.stated.as_ref().and_then(|own| own.outputs[outputs[0]].sd);
        let single = stated.unwrap_or(mean.sqrt());
        CurveNoise {
            sd: single / law.memory.variance().sqrt(),
            wander: ReplicateVariation::default(),
            ..flat(&law)
        }
    };
    if let Some(sd) = sd {
        own.sd = sd / own.memory.variance().sqrt();
        own.profile = vec![1.0; outputs.len()];
        own.wander = ReplicateVariation::default();
    }
    own
}

/// Independent noise of size one.
fn white() -> CurveNoise {
    CurveNoise {
        sd: 1.0,
        memory: crate::gap::noise::Autoregression::white(),
        level: 0.0,
        wander: ReplicateVariation::default(),
        profile: Vec::new(),
    }
}

/// The profile at some outputs: that of the nearest measured one.
fn nearest(measured: &[usize], profile: &[f64], outputs: &[usize]) -> Vec<f64> {
    let one = |i: &usize| {
        let k = measured.partition_point(|m| m < i).min(measured.len() - 1);
        let before = k.saturating_sub(1);
        let nearer = measured[k].abs_diff(*i) <= measured[before].abs_diff(*i);
        profile[if nearer { k } else { before }]
    };
    outputs.iter().map(one).collect()
}
