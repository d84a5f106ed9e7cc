//! Warnings of the search over intervals.

use lacuna::run::Observer;

use super::super::Quantified;

/// Warns of bounds of quantities that are undefined at some draws.
pub(in super::super) fn warn(quantified: &Quantified, observer: &dyn Observer) {
    let Some(found) = quantified.propagated.as_ref().and_then(|all| all.bounds.as_ref()) else {
        return;
    };
    for (about, bounds) in quantified.about.quantities.iter().zip(&found.quantities) {
        let name = &about.name;
        let Some(bounds) = bounds else {
            observer
                .warn(&format!("the quantity `{name}` is undefined everywhere in the intervals"));
            continue;
        };
        if bounds.undefined > 0 {
            observer.warn(&format!(
                "the quantity `{name}` is undefined at up to {} of {} draws in the intervals; its bounds are those of the \
                 others",
                bounds.undefined, found.draws
            ));
        }
    }
}
