//! Finding about a calibration that lacks what a search found; the calibration was assessed before the search.

use super::findings::CalibrationFindings;
use crate::assess::Finding;
use crate::assess::missing::{EstimateChange, effect};
use crate::gap::report::verdict;
use crate::gap::result::{GapResult, Shift};
use crate::gap::search::VerdictKind;

/// The finding; `None` if nothing is missing that the data can show.
pub fn finding(gap: &GapResult, calibration: &CalibrationFindings) -> Option<Finding> {
    if matches!(gap.verdict.word, VerdictKind::None | VerdictKind::NotVisible) {
        return None;
    }
    // A name that held-out data contradict is in no study.
    let is_added = !gap.worth_adding().is_empty();
    let change = |shift: &Shift| {
        let own = calibration.coordinates.iter().find(|own| own.name == shift.name)?;
        let change = (shift.value[1] - shift.value[0]) / own.sd;
        change.is_finite().then(|| EstimateChange { parameter: own.name.clone(), shift: change })
    };
    let changes: Vec<EstimateChange> = gap.parameters.iter().filter_map(change).collect();
    Some(effect(&verdict(gap), &changes, is_added))
}
