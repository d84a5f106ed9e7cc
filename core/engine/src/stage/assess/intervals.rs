//! Check of the searches over intervals of parameters.

use crate::assess::{Finding, intervals as check};
use crate::stage::quantities::{Quantified, Range};

/// Findings about the bounds of each quantity.
pub(super) fn findings(quantified: &Quantified) -> Vec<Finding> {
    let bounds = quantified.propagated.iter().flat_map(|all| &all.bounds);
    let quantities = bounds.flat_map(|found| &found.quantities);
    let share = |range: &Range| {
        let width = range.upper.value - range.lower.value;
        range.lower.difference.max(range.upper.difference) / width
    };
    let names = quantified.about.quantities.iter().map(|about| about.name.as_str());
    names
        .zip(quantities)
        .filter_map(|(name, bounds)| {
            let named = bounds.as_ref()?.named();
            let differing = named.iter().filter(|(_, range)| !range.is_agreed());
            let figures: Vec<(&str, f64)> =
                differing.map(|(figure, range)| (*figure, share(range))).collect();
            check::differing(name, &figures)
        })
        .collect()
}
