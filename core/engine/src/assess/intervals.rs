//! Searches for bounds over intervals of parameters that do not agree.

use super::words::percent;
use super::{Finding, Rule, Severity};

const CODE: &str = "interval_search";

/// Share of the width of bounds by which two searches may differ.
pub const AGREES: f64 = 0.02;

const SEARCH: &str =
    "raise `forward.intervals.points`, or give numbers to parameters that matter little";

/// Rules of this module; see [`super::rules`].
pub fn rules() -> Vec<Rule> {
    vec![Rule {
        code: CODE,
        looks_at: "the distance between the results of two independent searches for the bounds of a quantity over intervals of \
                   parameters, as a share of the width of the bounds"
            .to_owned(),
        threshold: format!(
            "{} of the width and one Monte Carlo standard error of the bound: reservation",
            percent(AGREES)
        ),
        why: "a search whose result depends on where it begins may have missed an extreme: true bounds may lie farther apart",
        action: SEARCH,
    }]
}

/// Finding about the bounds of a quantity: names of the figures on which the searches differ, with the difference as a share
/// of the width.
pub fn differing(quantity: &str, figures: &[(&str, f64)]) -> Option<Finding> {
    let largest = figures.iter().map(|(_, share)| *share).fold(f64::NAN, f64::max);
    let names: Vec<&str> = figures.iter().map(|(name, _)| *name).collect();
    let message = format!(
        "two independent searches over the intervals found different bounds of {}; true bounds may lie farther apart",
        names.join(", ")
    );
    let found = (CODE, quantity);
    (!figures.is_empty())
        .then(|| Finding::new(found, (largest, AGREES), Severity::Reservation, message, SEARCH))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differing_searches_are_a_reservation() {
        assert_eq!(differing("peak", &[]), None);
        let found = differing("peak", &[("mean", 0.03), ("sd", 0.5)]).unwrap();
        assert_eq!((found.severity, found.figure), (Severity::Reservation, Some(0.5)));
        assert!(found.sentence().starts_with("peak: ") && found.message.contains("mean, sd"));
    }
}
