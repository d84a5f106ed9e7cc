//! Populations whose scatter the groups do not determine.

use super::words::short;
use super::{Finding, Rule, Severity};

const CODE: &str = "few_groups";

/// Number of measured groups up to which the scatter between groups counts as undetermined, and the range of its posterior
/// relative to that of its prior from which on it does with more groups.
const FEW: (usize, f64) = (3, 0.8);

const MORE: &str =
    "measure more groups, or give the scatter a prior from other knowledge, such as tolerances";

/// Rules of this module; see [`super::rules`].
pub fn rules() -> Vec<Rule> {
    vec![Rule {
        code: CODE,
        looks_at: "number of measured groups of a population, and central 95 % range of its standard deviation or scale \
                   relative to that of the prior"
            .to_owned(),
        threshold: format!("at most {} groups, or a range of more than {}: note", FEW.0, FEW.1),
        why: "with few groups the posterior of the scatter between groups is mostly its prior, and so are the pooling of the \
              groups and the prediction for a new one (Gelman, Bayesian Analysis 1 (2006) 515)",
        action: MORE,
    }]
}

/// Finding about a population with this number of measured groups and range of its scale relative to the prior's.
pub fn few_groups(parameter: &str, groups: usize, range: f64) -> Option<Finding> {
    if groups > FEW.0 && range <= FEW.1 {
        return None;
    }
    let message = format!(
        "the scatter of `{parameter}` between groups is known from {groups} groups: its 95 % range is {} of that of its \
         prior",
        short(range)
    );
    Some(Finding::new((CODE, parameter), (range, FEW.1), Severity::Note, message, MORE))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_groups_or_an_unchanged_prior_are_noted() {
        assert!(few_groups("x", 3, 0.2).is_some());
        assert!(few_groups("x", 8, 0.95).is_some());
        assert_eq!(few_groups("x", 8, 0.3), None);
    }
}
