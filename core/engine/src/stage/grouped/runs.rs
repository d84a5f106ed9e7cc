//! Runs and errors of the emulator as those of a study with parameters by group.

use lacuna::data::Ensemble;
use lacuna_linalg::Matrix;

use super::Spread;
use crate::stage::emulator_error::Curves;
use crate::stage::surrogate::{Errors, Fitted};
use crate::study::Study;
use crate::study::hierarchy::Trained;

/// The runs with a column for each parameter of the study: the members of a group have the value of the run, location and
/// scale of a population their prior medians.
pub(super) fn ensemble(study: &Study, trained: &Trained, own: Ensemble) -> Ensemble {
    let spread = Spread::of(study, trained);
    Ensemble {
        parameters: study.parameters.iter().map(|p| p.name.clone()).collect(),
        units: study.parameters.iter().map(|p| p.unit.clone()).collect(),
        points: points(study, trained, &own.points),
        layouts: study.layouts.clone(),
        responses: spread.curves(&own.responses),
        ..own
    }
}

/// The fitted surrogate with the errors of each group.
pub(super) fn fitted(study: &Study, trained: &Trained, own: Fitted) -> Fitted {
    let spread = Spread::of(study, trained);
    let curves = Curves {
        points: points(study, trained, &own.curves.points),
        errors: spread.curves(&own.curves.errors),
        stated: own.curves.stated.as_ref().map(|stated| spread.curves(stated)),
    };
    let errors = Errors {
        loo_by_output: spread.curve(&own.errors.loo_by_output),
        by_group: by_group(study, trained, &spread, &own.errors),
        ..own.errors
    };
    Fitted {
        errors,
        own_samples: own.own_samples.as_ref().map(|samples| spread.curves(samples)),
        sample_points: points(study, trained, &own.sample_points),
        curves,
        bytes: own.bytes,
        active: own.active,
    }
}

pub(super) fn points(study: &Study, trained: &Trained, own: &Matrix) -> Matrix {
    let middle: Vec<f64> = study.parameters.iter().map(|p| p.prior.quantile(0.5)).collect();
    let row = |run: &[f64]| {
        let mut row = middle.clone();
        for part in &trained.parts {
            part.parameters.iter().zip(run).for_each(|(&j, x)| row[j] = *x);
        }
        row
    };
    Matrix::from_rows(middle.len(), own.iter_rows().map(row))
}

/// Errors of each group of outputs: those of the outputs of the runs that it copies.
fn by_group(
    study: &Study,
    trained: &Trained,
    spread: &Spread,
    errors: &Errors,
) -> Vec<(String, f64, f64, f64)> {
    let groups = trained.study.layouts.groups();
    let mut place = vec![0.0; trained.study.layouts.len()];
    for (number, group) in groups.iter().enumerate() {
        group.indices.iter().for_each(|&i| place[i] = number as f64);
    }
    let place = spread.curve(&place);
    let of = |group: &lacuna::data::layout::Group| {
        let own = group.indices.first().map_or(0, |&i| place[i] as usize);
        let (_, mae, rmse, loo) = errors.by_group.get(own)?;
        Some((group.name.clone(), *mae, *rmse, *loo))
    };
    study.layouts.groups().iter().filter_map(of).collect()
}
