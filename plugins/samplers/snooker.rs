//! The snooker update of ter Braak and Vrugt, "Differential evolution Markov chain with snooker updater and
//! fewer chains", Statistics and Computing 18 (2008) 435.

use lacuna::math::random::uniform;
use rand::Rng;

/// Writes `x + g (a - b)`, with the difference projected on the line from `anchor` to `x` and `g` uniform between 1.2
/// and 2.2, into `new`. Returns the logarithm of `(|new - anchor| / |x - anchor|)^(d - 1)`, the factor on the ratio
/// of the densities (equation 5).
///
/// Distances are measured with each coordinate in units of `lengths`, which must be the same for every move.
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
    // The proposed point is the anchor plus this multiple of the line.
    let multiple = 1.0 + (1.2 + uniform(rng)) * along / square;
    if !(multiple.abs() > 0.0 && multiple.is_finite()) {
        // A walker at its anchor defines no line: it stays.
        new.copy_from_slice(x);
        return f64::NEG_INFINITY;
    }
    for ((new, x), anchor) in new.iter_mut().zip(x).zip(anchor) {
        *new = anchor + multiple * (x - anchor);
    }
    (x.len() as f64 - 1.0) * multiple.abs().ln()
}

#[cfg(test)]
mod tests {
    use lacuna::math::random::Stream;

    use super::*;

    #[test]
    fn a_move_stays_on_its_line_and_has_the_factor_of_the_paper() {
        let (x, anchor) = ([1.0, 2e3, -0.5], [0.0, -1e3, 0.5]);
        let (a, b) = ([0.3, 5e2, 1.0], [-0.4, 2e3, 0.0]);
        let mut rng = Stream::root(1).generator();
        for _ in 0..50 {
            let mut new = [0.0; 3];
            let found = propose(&x, &anchor, (&a, &b), &[1.0, 1e3, 1.0], &mut new, &mut rng);
            let share: Vec<f64> =
                (0..3).map(|j| (new[j] - anchor[j]) / (x[j] - anchor[j])).collect();
            assert!(share.iter().all(|s| (s - share[0]).abs() < 1e-12));
            assert!((found - 2.0 * share[0].abs().ln()).abs() < 1e-12);
            // The difference (0.7, -1.5, 1) in units of the lengths, along the line (1, 3, -1), which has the
            // square 11, is -4.8 / 11 of it.
            let length = (share[0] - 1.0) / (-4.8 / 11.0);
            assert!((1.2..=2.2).contains(&length), "{length}");
        }
    }

    #[test]
    fn a_point_on_its_anchor_stays() {
        let mut rng = Stream::root(1).generator();
        let (x, mut new) = ([1.0, 2.0], [0.0; 2]);
        let found = propose(&x, &x, (&[1.0, 0.0], &[0.0, 0.0]), &[1.0; 2], &mut new, &mut rng);
        assert_eq!((found, new), (f64::NEG_INFINITY, x));
    }
}
