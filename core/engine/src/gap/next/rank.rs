//! The order of the options.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{NextData, NextOption};

/// Number of standard errors within which two options count as equal.
const EQUAL: f64 = 2.0;

/// Purpose of the next data: what they should tell.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Wanted {
    /// The name of what is missing.
    Name,
    /// The parameters of the model.
    Parameters,
    /// The quantity of `[gap.quantity]`.
    Quantity,
}

impl NextData {
    /// The options in decreasing order of the bits on what is wanted per cost; those on the parameters decide between
    /// equal ones.
    pub fn ranked(mut self, by: Wanted) -> Self {
        let per_cost = |own: &NextOption| own.bits(by).0 / own.cost;
        let second = |own: &NextOption| own.parameter_bits / own.cost;
        self.options.sort_by(|a, b| {
            per_cost(b).total_cmp(&per_cost(a)).then(second(b).total_cmp(&second(a)))
        });
        self.ranked_by = by;
        let Some(best) = self.options.first().cloned() else { return self };
        for own in &mut self.options {
            let error = (own.bits(by).1 / own.cost).hypot(best.bits(by).1 / best.cost);
            own.equal_to_best = per_cost(&best) - per_cost(own) <= EQUAL * error;
        }
        self
    }

    /// Returns true if there are bits on what is wanted: a choice of a name, or a quantity.
    pub fn has(&self, wanted: Wanted) -> bool {
        match wanted {
            Wanted::Name => !self.hypotheses.is_empty(),
            Wanted::Parameters => true,
            Wanted::Quantity => self.options.iter().any(|own| own.quantity_bits.is_some()),
        }
    }
}

impl NextOption {
    /// The expected bits on what is wanted, and their Monte Carlo standard error.
    pub fn bits(&self, wanted: Wanted) -> (f64, f64) {
        match wanted {
            Wanted::Name => (self.name_bits, self.name_error),
            Wanted::Parameters => (self.parameter_bits, 0.0),
            Wanted::Quantity => {
                (self.quantity_bits.unwrap_or(0.0), self.quantity_error.unwrap_or(0.0))
            }
        }
    }
}
