//! The snooker update of ter Braak and Vrugt, "Differential evolution Markov chain with snooker updater and
//! fewer chains", Statistics and Computing 18 (2008) 435.

use lacuna::math::random::uniform;
use rand::Rng;

/// Writes `x + g (a - b)`, with the difference projected on the line from `anchor` to `x` and `g`
/// uniform between 1.2 and 2.2, into `new`; gives the logarithm of `(|new - anchor| / |x -
/// anchor|)^(d - 1)`, the factor that belongs to the ratio of the densities (equation 5).
///
/// The projection takes coordinates in units of `lengths`, which have to be the same for every move.
pub(super) fn propose(
    x: &[f64],
    anchor: &[f64],
    (a, b): (&[f64], &[f64]),
    lengths: &[f64],
    new: &mut [f64],
    rng: &mut impl Rng,
) -> f64 {
    let (mut along, mut square) = (0.0, 0.0);
    for j in 0..x.len() {
        let line = (x[j] - anchor[j]) / lengths[j];
        along += line * (a[j] - b[j]) / lengths[j];
        square += line * line;
    }
    // The new place is the anchor and this multiple of the line.
    let multiple = 1.0 + (1.2 + uniform(rng)) * along / square;
    if !(multiple.abs() > 0.0 && multiple.is_finite()) {
        // A walker on its anchor has no line: it stays.
        new.copy_from_slice(x);
        return f64::NEG_INFINITY;
    }
    for ((new, x), anchor) in new.iter_mut().zip(x).zip(anchor) {
        *new = anchor + multiple * (x - anchor);
    }
    (x.len() as f64 - 1.0) * multiple.abs().ln()
}
