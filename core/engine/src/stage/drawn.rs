//! Responses at draws of the posterior, for figures.

use lacuna::data::Draws;

use crate::stage::inverse_problem::InverseProblem;
use crate::stage::predict;
use crate::study::Study;

/// Largest number of draws.
const MOST_DRAWS: usize = 120;

/// Largest number of values of all responses together.
const MOST_VALUES: usize = 1 << 20;

/// Smallest number of draws worth a figure.
const FEWEST: usize = 10;

/// Draws of the posterior with the model's responses there.
#[derive(Debug, Clone, PartialEq)]
pub struct DrawnResponses {
    /// Draws, all coordinates in natural units.
    pub points: Vec<Vec<f64>>,
    /// Emulated response at each draw with the study's effects, without noise; one value per output.
    pub responses: Vec<Vec<f64>>,
}

/// Evenly spaced draws after the burn-in with their responses; `None` without an emulator, since the model itself may take
/// hours, and for records so long that few draws would have room.
pub fn drawn(study: &Study, problem: &InverseProblem<'_>, kept: &Draws) -> Option<DrawnResponses> {
    problem.emulator()?;
    let outputs = study.layouts.len().max(1);
    let count = MOST_DRAWS.min(kept.len()).min(MOST_VALUES / outputs);
    if count < FEWEST {
        return None;
    }
    let points = kept.points().select_rows(&predict::spaced(count, kept.len()));
    let responses = predict::responses(study, problem.forward(), &points);
    Some(DrawnResponses { points: points.iter_rows().map(<[f64]>::to_vec).collect(), responses })
}
