//! Elementary effects from runs of which each differs from the one before in a single input.

use lacuna_linalg::Matrix;

/// Largest difference of two positions that are the same up to rounding errors.
const SAME: f64 = 1e-6;

/// Elementary effects of one input: the change of the response divided by that of the input, as a change over the
/// whole range of the input's design, in standard deviations of the response over the runs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ElementaryEffects {
    /// Number of effects.
    pub count: usize,
    /// Mean absolute effect `mu*`, root mean square over the outputs for several outputs.
    pub mean_absolute: f64,
    /// Standard deviation `sigma` of the effects, over the outputs likewise: large beside `mu*` if the input acts
    /// nonlinearly or together with others. NaN for fewer than two effects.
    pub sd: f64,
}

/// Sums over the effects of one input, one entry per output.
#[derive(Clone)]
struct Sums {
    count: usize,
    absolute: Vec<f64>,
    plain: Vec<f64>,
    squares: Vec<f64>,
}

/// Returns the elementary effects of each input at `positions` in the unit cube (`runs x inputs`); `scaled` are the
/// responses with the sum of variances one.
pub(super) fn elementary(positions: &Matrix, scaled: &Matrix) -> Vec<ElementaryEffects> {
    let outputs = scaled.columns();
    let none = || vec![0.0; outputs];
    let empty = Sums { count: 0, absolute: none(), plain: none(), squares: none() };
    let mut sums = vec![empty; positions.columns()];
    // Runs of a single input differ in it in any design.
    if varying(positions) < 2 {
        return sums.iter().map(Sums::effects).collect();
    }
    for i in 1..positions.rows() {
        let (before, after) = (positions.row(i - 1), positions.row(i));
        let mut changed = (0..before.len()).filter(|&j| (after[j] - before[j]).abs() > SAME);
        let (Some(j), None) = (changed.next(), changed.next()) else { continue };
        let step = after[j] - before[j];
        let own = &mut sums[j];
        own.count += 1;
        for (o, (y, x)) in scaled.row(i).iter().zip(scaled.row(i - 1)).enumerate() {
            let effect = (y - x) / step;
            own.absolute[o] += effect.abs();
            own.plain[o] += effect;
            own.squares[o] += effect * effect;
        }
    }
    sums.iter().map(Sums::effects).collect()
}

/// Returns the number of inputs that differ among the runs.
fn varying(positions: &Matrix) -> usize {
    let varies = |j: &usize| {
        let mut values = positions.iter_rows().map(|row| row[*j]);
        let first = values.next();
        values.any(|x| Some(x) != first)
    };
    (0..positions.columns()).filter(varies).count()
}

impl Sums {
    fn effects(&self) -> ElementaryEffects {
        let n = self.count as f64;
        let mean_squares: f64 = self.absolute.iter().map(|sum| (sum / n).powi(2)).sum();
        let variance = |(plain, squares): (&f64, &f64)| (squares - plain * plain / n).max(0.0);
        let variances: f64 = self.plain.iter().zip(&self.squares).map(variance).sum();
        ElementaryEffects {
            count: self.count,
            mean_absolute: if self.count > 0 { mean_squares.sqrt() } else { f64::NAN },
            sd: if self.count > 1 { (variances / (n - 1.0)).sqrt() } else { f64::NAN },
        }
    }
}
