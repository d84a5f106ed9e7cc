//! Two ensembles of different cost: the difference between fine and cheap runs as a function of the parameters.
//!
//! The response of the fine runs is modelled as `y(x) = scale * c(x) + d(x)`, with the cheap response `c`, one factor
//! per group of outputs and a difference `d` represented by any surrogate (Kennedy and O'Hagan, Biometrika 87 (2000) 1;
//! by levels, with the cheap response known where both were run: Le Gratiet and Garnier, Int. J. Uncertainty
//! Quantification 4 (2014) 365; with polynomials: Palar, Tsuchiya and Parks, Comput. Methods Appl. Mech. Engrg. 305
//! (2016) 579). One of several such [rules](Rule) is chosen for each group by the errors at held-out fine runs, so that
//! an uninformative cheap ensemble is not used.

mod bytes;
mod choose;
mod combined;
mod lesson;
mod rule;
#[cfg(test)]
mod tests;

use lacuna::math::moments;
use lacuna::plugin::Fact;
use lacuna_linalg::Matrix;
use serde::{Deserialize, Serialize};

pub use bytes::{joined, split};
pub use choose::{Coverage, cover};
pub use combined::{Combined, Source};
pub use lesson::Lesson;
pub use rule::{Rule, Scale, Shape};

/// Relation of fine runs to cheap runs.
#[derive(Debug, Clone, PartialEq)]
pub struct Difference {
    /// Factor of the cheap response, one per output.
    pub scale: Vec<f64>,
    /// Offset, one per output.
    pub offset: Vec<f64>,
    /// For each output, true if the emulator of the difference is added too.
    pub emulated: Vec<bool>,
    /// Saved bytes of that emulator; `None` if no output uses it.
    pub emulator: Option<Vec<u8>>,
    /// Fine response minus prediction for each held-out fine run, `runs x outputs`.
    pub residuals: Matrix,
    /// Mean square of these errors divided by the variance of the fine responses, one per output; zero if that is
    /// constant.
    pub relative: Vec<f64>,
    /// Decision for each group of outputs.
    pub verdicts: Vec<Verdict>,
}

/// Decision for a group of outputs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Verdict {
    /// Name of the group, such as a sensor.
    pub group: String,
    /// Rule that is used.
    pub rule: Rule,
    /// Factor of the cheap response.
    pub scale: f64,
    /// Root mean square error of each rule at held-out fine runs, in the response's unit; `None` if it could not be
    /// fitted.
    pub left_out: Vec<(Rule, Option<f64>)>,
}

impl Verdict {
    /// Root mean square error of a rule at held-out runs.
    pub fn error_of(&self, rule: Rule) -> Option<f64> {
        self.left_out.iter().find(|(other, _)| *other == rule).and_then(|(_, error)| *error)
    }
}

impl Difference {
    /// Facts for the report: the error of each rule over all groups, and the rule used for each group.
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

    /// Returns true if an output differs from the cheap response.
    pub fn corrects(&self, output: usize) -> bool {
        self.emulated[output] || self.offset[output] != 0.0 || self.scale[output] != 1.0
    }

    /// Returns true if anything but the cheap response itself is used.
    pub fn is_used(&self) -> bool {
        self.verdicts.iter().any(|verdict| verdict.rule != Rule::SAME)
    }
}

fn squared(values: &[f64]) -> Vec<f64> {
    values.iter().map(|x| x * x).collect()
}
