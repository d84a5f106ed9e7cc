//! One series as a Markov process observed in noise: its covariance `A = C + D` is whitened at a cost proportional to
//! the length.
//!
//! The Kalman filter of the [state](super::kernel) gives the variances `f` and the gains of the innovations, which
//! are independent: `A = L diag(f) L'` with `L^-1` the filter. Run backwards it is `L'^-1`, with the weights `r` of
//! the state and their variance `N` (Durbin and Koopman, Time Series Analysis by State Space Methods (2012), 4.4 and
//! 4.5):
//!
//! ```text
//! s = Phi' r,  u = e/f - K's,  r = s + h u,  u = A^-1 y,
//! M = Phi' N Phi,  N = (I - K h')' M (I - K h') + h h'/f,  (A^-1)_tt = 1/f + K'M K.
//! ```
//!
//! `N` is also the derivative of `log det A = sum log f` with respect to the predicted covariance of the state.

use lacuna_linalg::Matrix;

use super::Kernel;
use super::kernel::Square;

/// Kalman filter of one series (see the module).
#[derive(Debug, Clone)]
pub(super) struct Filter {
    steps: Vec<Step>,
    length: f64,
}

/// One value of the series.
#[derive(Debug, Clone)]
struct Step {
    /// Distance from the value before, times the rate.
    distance: f64,
    /// Transition of the state from the value before, and its derivative with respect to the distance.
    transition: (Square, Square),
    /// Kalman gain `K`.
    gain: [f64; 3],
    /// Variance of the innovation, and its root.
    variance: f64,
    root: f64,
    /// Covariance of the state given the values so far, minus that of the process. Storing the difference avoids
    /// cancellation in the prediction.
    known: Square,
}

/// Traces with the inverse covariance.
pub(super) struct Traces {
    /// Diagonal of `A^-1`.
    pub diagonal: Vec<f64>,
    /// `tr(A^-1 dC/dlength)`.
    pub by_length: f64,
}

impl Filter {
    /// Filters a series at these values of the axis, with these variances of the noise; `None` if an innovation
    /// variance is not positive and finite.
    pub fn new(
        kernel: Kernel,
        grid: &[f64],
        (sd, length): (f64, f64),
        noise: impl Iterator<Item = f64>,
    ) -> Option<Self> {
        let rate = kernel.rate(length);
        let process = kernel.stationary().map(|row| row.map(|x| x * sd * sd));
        let mut predicted = process;
        let mut steps: Vec<Step> = Vec::with_capacity(grid.len());
        for (t, noise) in noise.enumerate() {
            let distance = if t == 0 { 0.0 } else { rate * (grid[t] - grid[t - 1]) };
            let transition = kernel.transition(distance);
            if let Some(last) = steps.last() {
                predicted = sandwich(&transition.0, &last.known);
                for (row, own) in predicted.iter_mut().zip(&process) {
                    row.iter_mut().zip(own).for_each(|(x, p)| *x += p);
                }
            }
            let variance = predicted[0][0] + noise;
            if !(variance > 0.0 && variance.is_finite()) {
                return None;
            }
            let gain = [0, 1, 2].map(|i| predicted[i][0] / variance);
            let mut known = predicted;
            for i in 0..3 {
                for j in 0..3 {
                    known[i][j] -= gain[i] * predicted[0][j] + process[i][j];
                }
            }
            let root = variance.sqrt();
            steps.push(Step { distance, transition, gain, variance, root, known });
        }
        Some(Self { steps, length })
    }

    /// Returns `log det A`.
    pub fn log_determinant(&self) -> f64 {
        self.steps.iter().map(|step| step.variance.ln()).sum()
    }

    /// Replaces the rows `X` of the series by `diag(f)^-1/2 L^-1 X`; inner products of its columns are then those
    /// with `A^-1`.
    pub fn whiten(&self, rows: &[usize], x: &mut Matrix) {
        let width = x.columns();
        let [mut a, mut b, mut c] = [0; 3].map(|_| vec![0.0; width]);
        for (step, &row) in self.steps.iter().zip(rows) {
            let [[p, q, r], [s, t, u], [v, w, z]] = step.transition.0;
            let ([k, l, m], scale) = (step.gain, 1.0 / step.root);
            let states = a.iter_mut().zip(&mut b).zip(&mut c);
            for (((a, b), c), y) in states.zip(x.row_mut(row)) {
                let (d, e, f) =
                    (p * *a + q * *b + r * *c, s * *a + t * *b + u * *c, v * *a + w * *b + z * *c);
                let innovation = *y - d;
                *a = d + k * innovation;
                *b = e + l * innovation;
                *c = f + m * innovation;
                *y = innovation * scale;
            }
        }
    }

    /// Replaces whitened rows by `A^-1 X`.
    pub fn back(&self, rows: &[usize], x: &mut Matrix) {
        let width = x.columns();
        let [mut a, mut b, mut c] = [0; 3].map(|_| vec![0.0; width]);
        let zero = [[0.0; 3]; 3];
        for (i, (step, &row)) in self.steps.iter().zip(rows).enumerate().rev() {
            let next = self.steps.get(i + 1).map_or(&zero, |step| &step.transition.0);
            let [[p, s, v], [q, t, w], [r, u, z]] = *next;
            let ([k, l, m], scale) = (step.gain, 1.0 / step.root);
            let states = a.iter_mut().zip(&mut b).zip(&mut c);
            for (((a, b), c), y) in states.zip(x.row_mut(row)) {
                let (d, e, f) =
                    (p * *a + q * *b + r * *c, s * *a + t * *b + u * *c, v * *a + w * *b + z * *c);
                *y = *y * scale - (k * d + l * e + m * f);
                *a = d + *y;
                *b = e;
                *c = f;
            }
        }
    }

    /// Returns the traces with `A^-1` that the derivatives with respect to the hyperparameters need.
    pub fn traces(&self) -> Traces {
        let mut diagonal = vec![0.0; self.steps.len()];
        let mut by_length = 0.0;
        // `M` of the recursion.
        let mut ahead = [[0.0; 3]; 3];
        for (t, step) in self.steps.iter().enumerate().rev() {
            let gain = step.gain;
            let image = ahead.map(|row| inner(&row, &gain));
            let own = 1.0 / step.variance + inner(&gain, &image);
            diagonal[t] = own;
            let mut weight = ahead;
            for i in 0..3 {
                weight[0][i] -= image[i];
                weight[i][0] -= image[i];
            }
            weight[0][0] += own;
            let (transition, slope) = &step.transition;
            if t > 0 {
                let through = product(slope, &self.steps[t - 1].known);
                let change = product(&through, &transposed(transition));
                let trace: f64 = weight.iter().zip(&change).map(|(a, b)| inner(a, b)).sum();
                by_length -= 2.0 * trace * step.distance / self.length;
            }
            ahead = sandwich(&transposed(transition), &weight);
        }
        Traces { diagonal, by_length }
    }
}

fn inner(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn transposed(a: &Square) -> Square {
    let mut turned = [[0.0; 3]; 3];
    for i in 0..3 {
        for j in 0..3 {
            turned[i][j] = a[j][i];
        }
    }
    turned
}

fn product(a: &Square, b: &Square) -> Square {
    let columns = transposed(b);
    a.map(|row| [inner(&row, &columns[0]), inner(&row, &columns[1]), inner(&row, &columns[2])])
}

/// Returns `A X A'`.
fn sandwich(a: &Square, x: &Square) -> Square {
    product(&product(a, x), &transposed(a))
}
