//! Derived quantities: further coordinates of a finished calibration, for everything that reports it.

use lacuna::data::Draws;
use lacuna::diagnose::Diagnosis;

use super::calibrate::{Calibrated, Coordinate};
use crate::study::Study;

/// The calibration with the study's derived quantities appended to its coordinates.
pub fn extended(study: &Study, calibrated: &Calibrated) -> Calibrated {
    let derived = study.derived();
    let mut all = calibrated.clone();
    if derived.is_empty() {
        return all;
    }
    let d = calibrated.draws.dimension();
    let values = |point: &[f64]| -> Vec<f64> { derived.iter().map(|q| q.value(point)).collect() };
    all.draws.values = calibrated
        .draws
        .values
        .chunks_exact(d)
        .flat_map(|point| [point.to_vec(), values(point)].concat())
        .collect();
    all.draws.names.extend(derived.iter().map(|quantity| quantity.name.clone()));
    let alone = Draws {
        names: derived.iter().map(|quantity| quantity.name.clone()).collect(),
        values: calibrated.draws.values.chunks_exact(d).flat_map(values).collect(),
        ..calibrated.draws.clone()
    };
    let outcome = &mut all.outcome;
    let kept = alone.from_step(outcome.burn_in);
    let judged = Diagnosis::of(&kept, outcome.diagnosis.ensemble);
    outcome.diagnosis.coordinates.extend(judged.coordinates);
    outcome.coordinates.extend(derived.iter().map(|quantity| Coordinate {
        name: quantity.name.clone(),
        symbol: quantity.symbol.clone(),
        unit: quantity.unit.clone(),
        prior: None,
        reference: quantity.reference,
    }));
    for point in [&mut outcome.map, &mut outcome.best_draw.0] {
        if !point.is_empty() {
            let more = values(point);
            point.extend(more);
        }
    }
    for (point, _) in &mut outcome.other_maxima {
        let more = values(point);
        point.extend(more);
    }
    all
}
