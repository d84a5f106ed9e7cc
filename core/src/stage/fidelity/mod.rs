//! Two ensembles of different cost: what the fine runs differ by from the cheap ones, as a function of the parameters.
//!
//! The response of the fine runs is taken as `y(x) = scale * c(x) + d(x)`, with the cheap response `c`, a factor for each
//! group of outputs and a difference `d` for which any surrogate stands (Kennedy and O'Hagan, Biometrika 87 (2000) 1; by
//! levels, with the cheap response known where both were run: Le Gratiet and Garnier, Int. J. Uncertainty
//! Quantification 4 (2014) 365; with polynomials: Palar, Tsuchiya and Parks, Comput. Methods Appl. Mech. Engrg. 305
//! (2016) 579). Which of several such [rules](Rule) is used is decided for each group by the errors at fine runs that
//! were left out, so that a cheap ensemble that says nothing is not used.

mod bytes;
mod choose;
mod combined;
mod lesson;
mod rule;
#[cfg(test)]
mod tests;

use serde::{Deserialize, Serialize};

use crate::linalg::Matrix;
use crate::math::moments;
use crate::plugin::Fact;

pub use bytes::{joined, split};
pub use choose::{Coverage, cover};
pub use combined::{Combined, Source};
pub use lesson::Lesson;
pub use rule::{Rule, Scale, Shape};

/// What was learned of fine runs beside cheap ones.
#[derive(Debug, Clone, PartialEq)]
pub struct Difference {
    /// The factor of the cheap response, one an output.
    pub scale: Vec<f64>,
    /// What is added to it, one an output.
    pub offset: Vec<f64>,
    /// Whether the emulator of the difference is added too, for each output.
    pub emulated: Vec<bool>,
    /// That emulator as its plugin saved it; none where no output wants it.
    pub emulator: Option<Vec<u8>>,
    /// Fine response minus prediction, of each fine run left out, `runs x outputs`.
    pub residuals: Matrix,
    /// The mean square of these errors over the variance of the fine responses, one an output; zero where that does not vary.
    pub relative: Vec<f64>,
    /// What was decided for each group of outputs.
    pub verdicts: Vec<Verdict>,
}

/// What was decided for a group of outputs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Verdict {
    /// The group, such as a sensor.
    pub group: String,
    /// The rule that is used.
    pub rule: Rule,
    /// The factor of the cheap response.
    pub scale: f64,
    /// The root mean square error of each rule at fine runs that were left out, in the response's unit; none where it could
    /// not be fitted.
    pub left_out: Vec<(Rule, Option<f64>)>,
}

impl Verdict {
    /// The root mean square error of a rule at runs left out.
    pub fn error_of(&self, rule: Rule) -> Option<f64> {
        self.left_out.iter().find(|(other, _)| *other == rule).and_then(|(_, error)| *error)
    }
}

impl Difference {
    /// What is worth telling: what each rule does, over all groups, and what is used where.
    pub fn facts(&self, unit: &str) -> Vec<Fact> {
        let mut facts = Vec::new();
        let Some(first) = self.verdicts.first() else { return facts };
        for (rule, _) in &first.left_out {
            let errors: Option<Vec<f64>> =
                self.verdicts.iter().map(|verdict| verdict.error_of(*rule)).collect();
            let error = errors.map(|errors| moments::mean(&squared(&errors)).sqrt());
            let used = self.verdicts.iter().filter(|verdict| verdict.rule == *rule).count();
            let of = if self.verdicts.len() == 1 {
                if used == 1 { ", used".to_owned() } else { String::new() }
            } else {
                format!(", used for {used} of {} groups", self.verdicts.len())
            };
            let error = error.map_or_else(
                || "cannot be fitted to so few runs".to_owned(),
                |error| format!("{error:.3e} {unit}"),
            );
            facts.push(Fact::new(
                format!("error at fine runs left out, {}", rule.words()),
                format!("{error}{of}"),
            ));
        }
        let scaled = self.verdicts.iter().filter(|v| v.rule.scale == Scale::Regressed);
        let scales: Vec<f64> = moments::sorted(&scaled.map(|v| v.scale).collect::<Vec<_>>());
        if let (Some(least), Some(most)) = (scales.first(), scales.last()) {
            let range = if scales.len() == 1 {
                format!("{least:.4}")
            } else {
                format!("{least:.4} to {most:.4}")
            };
            facts.push(Fact::new("factor of the cheap response", range));
        }
        facts
    }

    /// Whether an output differs from the cheap response.
    pub fn corrects(&self, output: usize) -> bool {
        self.emulated[output] || self.offset[output] != 0.0 || self.scale[output] != 1.0
    }

    /// Whether anything but the cheap response itself is used.
    pub fn is_used(&self) -> bool {
        self.verdicts.iter().any(|verdict| verdict.rule != Rule::SAME)
    }
}

fn squared(values: &[f64]) -> Vec<f64> {
    values.iter().map(|x| x * x).collect()
}
