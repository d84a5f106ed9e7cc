//! Numerical error of a study with parameters by group: that of the model, the same in each group.

use lacuna_run::Kept;

use super::{Spread, hash, runs};
use crate::stage::fidelity::Difference;
use crate::stage::numerical_error::NumericalError;
use crate::study::Study;

/// The numerical error of a study, from that of the study that is trained.
pub fn numerical_error(study: &Study, own: Kept<NumericalError>) -> Kept<NumericalError> {
    let Some(trained) = &study.hierarchy.trained else { return own };
    let spread = Spread::of(study, trained);
    let prediction = own.value.prediction.map(|prediction| Difference {
        scale: spread.curve(&prediction.scale),
        offset: spread.curve(&prediction.offset),
        emulated: spread.curve(&prediction.emulated),
        residuals: spread.curves(&prediction.residuals),
        relative: spread.curve(&prediction.relative),
        ..prediction
    });
    let value = NumericalError {
        differences: spread.curves(&own.value.differences),
        points: runs::points(study, trained, &own.value.points),
        prediction,
        region: own.value.region,
    };
    let hash = hash(study, trained, &own.hash);
    Kept { value, hash, ..own }
}

/// Factor, offset and choice of the predicted difference by output of the model: `(scale, offset, emulated)`.
pub fn of_model(study: &Study, prediction: &Difference) -> (Vec<f64>, Vec<f64>, Vec<bool>) {
    let Difference { scale, offset, emulated, .. } = prediction;
    let Some(trained) = &study.hierarchy.trained else {
        return (scale.clone(), offset.clone(), emulated.clone());
    };
    let outputs = trained.study.layouts.len();
    let spread = Spread::of(study, trained);
    (
        spread.collected(scale, outputs),
        spread.collected(offset, outputs),
        spread.collected(emulated, outputs),
    )
}

impl Spread {
    /// Values by output of the model, from those by output of the study.
    fn collected<T: Copy + Default>(&self, all: &[T], outputs: usize) -> Vec<T> {
        let mut own = vec![T::default(); outputs];
        for (from, to) in self.parts.iter().flat_map(|part| &part.outputs) {
            own[from.clone()].copy_from_slice(&all[to.clone()]);
        }
        own
    }
}
