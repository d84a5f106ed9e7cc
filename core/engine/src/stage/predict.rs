//! Responses of the forward map with the study's effects.

use lacuna::plugin::Forward;
use lacuna::plugin::effect::Placed;
use lacuna_linalg::Matrix;

use crate::study::Study;

/// Largest number of values held at once for predictions at many draws (256 MiB).
const ROOM: usize = 1 << 25;

/// Smallest number of draws that represents a posterior, however long the records are.
const FEWEST: usize = 100;

/// Number of values requested from the forward map at once.
const BATCH: usize = 1 << 22;

/// Number of the draws for which `numbers` values each can be held: all of them, unless the records are long.
pub fn affordable(draws: usize, numbers: usize) -> usize {
    draws.min((ROOM / numbers.max(1)).max(FEWEST))
}

/// `count` of `draws` indices, evenly spaced.
pub fn spaced(count: usize, draws: usize) -> Vec<usize> {
    (0..count).map(|k| (2 * k + 1) * draws / (2 * count)).collect()
}

/// Number of points whose responses are requested from the forward map at once.
pub fn together(forward: &dyn Forward) -> usize {
    (BATCH / forward.outputs().max(1)).max(1)
}

/// Response at each point; a point holds parameters, parameters of effects and hyperparameters in natural units, one
/// per row.
pub fn responses(study: &Study, forward: &dyn Forward, points: &Matrix) -> Vec<Vec<f64>> {
    let rows: Vec<usize> = (0..points.rows()).collect();
    let batches = rows.chunks(together(forward));
    batches.flat_map(|rows| batch(study, forward, &points.select_rows(rows))).collect()
}

fn batch(study: &Study, forward: &dyn Forward, points: &Matrix) -> Vec<Vec<f64>> {
    let d = study.parameters.len();
    let theta = Matrix::from_rows(d, points.iter_rows().map(|p| &p[..d]));
    let mean = forward.mean(&theta);
    let effects = study.placed_effects();
    let rows = mean.iter_rows().zip(points.iter_rows());
    rows.map(|(mean, point)| with_effects(&effects, mean.to_vec(), point.split_at(d))).collect()
}

/// A response of the model with effects. The point is given as its parameters, and what follows them: the unknowns of the
/// effects first.
pub fn with_effects(
    effects: &[Placed<'_>],
    mut response: Vec<f64>,
    (parameters, others): (&[f64], &[f64]),
) -> Vec<f64> {
    let mut from = 0;
    for effect in effects {
        let count = effect.absent().len();
        response = effect.apply(&response, &others[from..from + count], parameters);
        from += count;
    }
    response
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_records_are_held_at_fewer_draws() {
        assert_eq!(affordable(400, 1000), 400);
        assert_eq!(affordable(400, 170_000), 197);
        assert_eq!(affordable(1000, 100_000_000), 100);
        assert_eq!(spaced(3, 9), [1, 4, 7]);
    }
}
