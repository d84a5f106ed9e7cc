//! The data of a search: measurements by condition and curve, a forward map, and its errors.

pub(in crate::gap) mod blocks;
pub mod hold_out;
pub mod stated;
pub mod transient;
pub mod wider;
pub mod with_effects;

use std::ops::Range;

use lacuna::data::layouts::SCENARIO;
use lacuna::data::{Coordinates, Layout, Layouts, Observations, Parameter};
use lacuna::plugin::Forward;
use lacuna::plugin::discrepancy::CommonError;

use lacuna_linalg::Matrix;

use super::experiment::wider::ExtendedMap;
use stated::Statement;

/// Measurements with the forward map that is to explain them.
#[derive(Clone)]
pub struct Experiment<'a> {
    /// The shapes of the responses.
    pub layouts: &'a Layouts,
    /// The unknowns of the forward map.
    pub parameters: &'a [Parameter],
    /// The forward map: from parameters to responses.
    pub forward: &'a dyn Forward,
    /// The forward map with inputs that the study holds fixed, if effects on the model are candidates.
    pub wide: Option<&'a ExtendedMap<'a>>,
    /// The covariance of the emulator's error and of other model errors, as factors `outputs x errors` in the
    /// response's unit: the same error for all replicates.
    pub common: Vec<CommonError>,
    /// The origins of these errors, one entry a column of their factors; empty if they are not known.
    pub origins: Vec<ErrorShares>,
    /// The part of that covariance outside the span of its factors (see
    /// [`emulator_error`](super::system::emulator_error)): the variance of innovations with the autocorrelation of the
    /// noise, one per output; empty for none.
    pub independent: Vec<f64>,
    /// Forms that a remainder may have besides smooth ones, `forms x outputs`, in the response's unit: the errors of a
    /// companion; no row for none.
    pub forms: Matrix,
    /// The noise of one replicate as the study states it, for curves without replicates.
    pub stated: Option<Statement>,
    /// The bounds within which the forward map is valid, if they are narrower than the priors.
    pub region: Option<Vec<(f64, f64)>>,
    /// The measurements, by condition.
    pub conditions: Vec<Condition>,
    /// All curves, in the order of their outputs.
    pub curves: Vec<MeasuredCurve>,
}

/// The origins of a known error, as shares of its variance.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct ErrorShares {
    /// The share of the emulator.
    pub emulator: f64,
    /// The share of the numerical error.
    pub numerics: f64,
}

/// The replicates under one set of conditions. Those of different conditions are independent.
#[derive(Debug, Clone, PartialEq)]
pub struct Condition {
    /// The name of the scenario; `None` if the study has none.
    pub scenario: Option<String>,
    /// The indices of its outputs.
    pub outputs: Range<usize>,
    /// The indices of its curves.
    pub curves: Range<usize>,
    /// The values of each replicate, one per output of the condition, in the response's unit; `None` if it was not
    /// measured.
    pub replicates: Vec<Vec<Option<f64>>>,
}

/// One curve of a condition, such as the signal of one sensor over time.
#[derive(Debug, Clone, PartialEq)]
pub struct MeasuredCurve {
    /// The labels by axis, without the scenario.
    pub labels: Vec<(String, String)>,
    /// The condition that it belongs to.
    pub condition: usize,
    /// The indices of its outputs.
    pub outputs: Range<usize>,
    /// The indices of the outputs that some replicate measured.
    pub measured: Vec<usize>,
    /// The coordinate of each measured output on the last axis, in its unit.
    pub at: Vec<f64>,
}

impl MeasuredCurve {
    /// The position of each measured value on the grid, as an index from zero at the first.
    pub fn places(&self) -> Vec<usize> {
        let usual = self.usual();
        let mut places = Vec::with_capacity(self.measured.len());
        for (k, &i) in self.measured.iter().enumerate() {
            let next = match k {
                0 => 0,
                _ => places[k - 1] + ((i - self.measured[k - 1] + usual / 2) / usual).max(1),
            };
            places.push(next);
        }
        places
    }

    /// The median distance of neighbouring values along the last axis, in its unit; 1 below two values.
    pub fn step(&self) -> f64 {
        let mut steps: Vec<f64> = self.at.windows(2).map(|w| w[1] - w[0]).collect();
        steps.sort_by(f64::total_cmp);
        steps.get(steps.len() / 2).copied().unwrap_or(1.0)
    }

    /// The median difference between the indices of neighbouring measured outputs.
    fn usual(&self) -> usize {
        let mut steps: Vec<usize> = self.measured.windows(2).map(|w| w[1] - w[0]).collect();
        steps.sort_unstable();
        steps.get(steps.len() / 2).copied().unwrap_or(1)
    }

    /// The labels in words; the name of the response if there are none.
    pub fn name(&self, layouts: &Layouts) -> String {
        if self.labels.is_empty() {
            return layouts.name().to_owned();
        }
        self.labels.iter().map(|(_, label)| label.as_str()).collect::<Vec<_>>().join(" ")
    }
}

impl<'a> Experiment<'a> {
    /// Measurements sorted by condition and curve.
    pub fn new(
        layouts: &'a Layouts,
        parameters: &'a [Parameter],
        forward: &'a dyn Forward,
        data: &Observations,
    ) -> Self {
        let mut conditions = Vec::new();
        let mut curves = Vec::new();
        for ((layout, range), block) in layouts.parts().zip(&data.blocks) {
            let scenarios = scenarios(layout);
            let length = layout.len() / scenarios.len().max(1);
            for (k, scenario) in scenarios.into_iter().enumerate() {
                let own = k * length..(k + 1) * length;
                let begin = curves.len();
                curves.extend(of_condition(layout, &own, range.start, conditions.len()));
                let measured = block.replicates.iter().map(|r| r.values[own.clone()].to_vec());
                conditions.push(Condition {
                    scenario,
                    outputs: range.start + own.start..range.start + own.end,
                    curves: begin..curves.len(),
                    replicates: measured.filter(|r| r.iter().any(Option::is_some)).collect(),
                });
            }
        }
        let mut all = Self {
            layouts,
            parameters,
            forward,
            wide: None,
            common: Vec::new(),
            origins: Vec::new(),
            independent: Vec::new(),
            forms: Matrix::default(),
            stated: None,
            region: None,
            conditions,
            curves,
        };
        for curve in &mut all.curves {
            curve.measured = curve.outputs.clone().collect();
        }
        all.remeasured()
    }

    /// The experiment with only those values of each curve that some replicate measured.
    pub fn remeasured(mut self) -> Self {
        let (counts, _) = self.means();
        for curve in &mut self.curves {
            let places = curve.measured.iter().zip(&curve.at);
            (curve.measured, curve.at) = places.filter(|(i, _)| counts[**i] > 0.0).unzip();
        }
        self
    }

    /// The complete replicates of a curve, `replicates x measured values`: those without a missing value.
    pub fn complete(&self, curve: &MeasuredCurve) -> Vec<Vec<f64>> {
        let condition = &self.conditions[curve.condition];
        let begin = condition.outputs.start;
        let values = |replicate: &Vec<Option<f64>>| -> Option<Vec<f64>> {
            curve.measured.iter().map(|i| replicate[i - begin]).collect()
        };
        if curve.measured.is_empty() {
            return Vec::new();
        }
        condition.replicates.iter().filter_map(values).collect()
    }

    /// The number of outputs.
    pub fn outputs(&self) -> usize {
        self.layouts.len()
    }

    /// True at each output that was measured.
    pub fn measured(&self) -> Vec<bool> {
        let mut all = vec![false; self.outputs()];
        self.curves.iter().flat_map(|curve| &curve.measured).for_each(|&i| all[i] = true);
        all
    }

    /// The number of replicates at each output, and their mean in the response's unit; zero if nothing was measured.
    pub fn means(&self) -> (Vec<f64>, Vec<f64>) {
        let mut counts = vec![0.0; self.outputs()];
        let mut means = vec![0.0; self.outputs()];
        for condition in &self.conditions {
            for replicate in &condition.replicates {
                for (i, y) in condition.outputs.clone().zip(replicate) {
                    if let Some(y) = y {
                        counts[i] += 1.0;
                        means[i] += y;
                    }
                }
            }
        }
        means.iter_mut().zip(&counts).filter(|(_, n)| **n > 0.0).for_each(|(m, n)| *m /= n);
        (counts, means)
    }

    /// The experiment with other measurements: for each condition its replicates, for each replicate one value per
    /// output.
    pub fn with_replicates(&self, replicates: Vec<Vec<Vec<Option<f64>>>>) -> Self {
        let mut other = self.clone();
        for (condition, replicates) in other.conditions.iter_mut().zip(replicates) {
            condition.replicates = replicates;
        }
        other
    }

    /// Returns true if the noise of some curve has to be estimated from a single record.
    pub fn has_records(&self) -> bool {
        let alone =
            |curve: &MeasuredCurve| !curve.measured.is_empty() && self.complete(curve).len() < 2;
        !self.stated.as_ref().is_some_and(Statement::is_complete) && self.curves.iter().any(alone)
    }

    /// The largest number of replicates of a condition.
    pub fn most_replicates(&self) -> usize {
        self.conditions.iter().map(|c| c.replicates.len()).max().unwrap_or(0)
    }
}

fn scenarios(layout: &Layout) -> Vec<Option<String>> {
    match layout.axes.first().filter(|axis| axis.name == SCENARIO) {
        Some(axis) => (0..axis.len()).map(|i| Some(axis.text(i))).collect(),
        None => vec![None],
    }
}

/// The curves of one condition: outputs `own` of a block that begins at `begin`.
fn of_condition(
    layout: &Layout,
    own: &Range<usize>,
    begin: usize,
    condition: usize,
) -> Vec<MeasuredCurve> {
    let grid = match layout.axes.last().map(|axis| &axis.coordinates) {
        Some(Coordinates::Grid { values, .. }) => values.clone(),
        _ => vec![0.0],
    };
    let length = grid.len().max(1);
    let is_grid =
        matches!(layout.axes.last().map(|axis| &axis.coordinates), Some(Coordinates::Grid { .. }));
    let labelled = layout.axes.len() - usize::from(is_grid);
    let label = |flat: usize| {
        let places = layout.place(flat);
        let named = layout.axes[..labelled].iter().zip(places);
        let named = named.filter(|(axis, _)| axis.name != SCENARIO);
        named.map(|(axis, i)| (axis.name.clone(), axis.text(i))).collect()
    };
    own.clone()
        .step_by(length)
        .map(|first| MeasuredCurve {
            labels: label(first),
            condition,
            outputs: begin + first..begin + first + length,
            measured: Vec::new(),
            at: grid.clone(),
        })
        .collect()
}
