//! Layout that is requested from a model, the shape of its answers, and the folder of its runs.

use std::path::PathBuf;

use lacuna::data::{Axis, Coordinates, Layout};
use lacuna::plugin::model::EvalError;
use lacuna::run::Stop;
use lacuna_linalg::Matrix;

/// The study's layout in the model's units, and the factor from the model's unit of the response to the study's.
pub(super) fn asked(ours: &Layout, theirs: &Layout) -> Result<(Layout, f64), Stop> {
    let mismatch = |what: &str| Stop::new(format!("{what} does not convert to the model's unit"));
    let factor =
        theirs.unit.factor_to(&ours.unit).ok_or_else(|| mismatch("the response's unit"))?;
    let axis = |(a, b): (&Axis, &Axis)| match (&a.coordinates, &b.coordinates) {
        (Coordinates::Grid { values, unit }, Coordinates::Grid { unit: known, .. }) => {
            let scale = unit.factor_to(known).ok_or_else(|| mismatch(&a.name))?;
            let values = values.iter().map(|v| v * scale).collect();
            Ok(Axis::grid(&a.name, values, known.clone()))
        }
        _ => Ok(a.clone()),
    };
    let axes = ours.axes.iter().zip(&theirs.axes).map(axis).collect::<Result<_, Stop>>()?;
    Ok((Layout { name: ours.name.clone(), unit: theirs.unit.clone(), axes }, factor))
}

/// Folder of a scenario's runs; in a study without scenarios, that of all runs.
pub(super) fn folder(place: usize, name: &str) -> PathBuf {
    if name.is_empty() {
        return PathBuf::new();
    }
    let plain = |c: char| if c.is_ascii_alphanumeric() || c == '-' { c } else { '_' };
    format!("{}-{}", place + 1, name.chars().map(plain).collect::<String>()).into()
}

/// Refuses derivatives that are not one row per output and one column per input.
pub(super) fn shaped(jacobian: &Matrix, outputs: usize, inputs: usize) -> Result<(), EvalError> {
    let (rows, columns) = (jacobian.rows(), jacobian.columns());
    if (rows, columns) == (outputs, inputs) {
        return Ok(());
    }
    Err(EvalError::Fatal(format!(
        "the model's derivatives are {rows} x {columns}, expected {outputs} outputs x {inputs} inputs"
    )))
}
