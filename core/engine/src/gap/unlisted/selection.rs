//! Forward selection of blocks of regressors in the metric of the noise, off the slopes of the calibrated unknowns.

use lacuna::math::random::{Stream, normal};
use lacuna_linalg::vector::{add_scaled, dot};
use lacuna_linalg::{
    Cholesky, Matrix, multiply_transposed, multiply_vector, thin_qr, transposed_multiply_vector,
};

use crate::gap::system::System;
use crate::gap::system::fit::{Fit, precision};

/// A direction that keeps less than this share of its squared length is taken as linearly dependent on those that were
/// chosen.
const OWN: f64 = 1e-4;

/// The metric `I - Q Q'` of whitened outputs, where `Q` is the part in the outputs of an orthonormal basis of the
/// slopes with their priors: it is the covariance of white noise after a calibration.
pub(in crate::gap) struct Metric {
    q: Matrix,
    outputs: usize,
}

impl Metric {
    pub fn new(system: &System<'_>, fit: &Fit) -> Option<Self> {
        Self::off(&fit.slopes, &system.priors().iter().map(precision).collect::<Vec<_>>())
    }

    /// The metric off whitened slopes, `unknowns x outputs`, with the precisions of the priors.
    pub fn off(slopes: &Matrix, precisions: &[f64]) -> Option<Self> {
        let (unknowns, outputs) = (slopes.rows(), slopes.columns());
        let width: Vec<f64> = precisions.iter().map(|p| 1.0 / p.sqrt()).collect();
        let augmented = Matrix::from_fn(outputs + unknowns, unknowns, |i, j| {
            if i < outputs {
                slopes[(j, i)] * width[j]
            } else {
                f64::from(u8::from(i - outputs == j))
            }
        });
        let q = if unknowns == 0 { augmented } else { thin_qr(&augmented).ok()?.q };
        Some(Self { q, outputs })
    }

    /// The metric's product with a vector.
    pub fn of(&self, white: &[f64]) -> Vec<f64> {
        let mut whole = white.to_vec();
        whole.resize(self.q.rows(), 0.0);
        self.rest(whole)
    }

    /// A draw of white noise, projected as a calibration would project it.
    pub fn noise(&self, stream: &Stream) -> Vec<f64> {
        let mut rng = stream.generator();
        self.rest((0..self.q.rows()).map(|_| normal(&mut rng)).collect())
    }

    fn rest(&self, mut whole: Vec<f64>) -> Vec<f64> {
        let along = transposed_multiply_vector(&self.q, &whole);
        let taken = multiply_vector(&self.q, &along);
        whole.iter_mut().zip(taken).for_each(|(x, t)| *x -= t);
        whole.truncate(self.outputs);
        whole
    }
}

/// Blocks of whitened directions, with the products that a selection needs.
pub(in crate::gap) struct Blocks<'a> {
    pub metric: &'a Metric,
    /// The directions, one per row, and their squared lengths in the metric.
    pub rows: &'a Matrix,
    pub squares: Vec<f64>,
    /// The rows of each block.
    pub members: &'a [Vec<usize>],
    /// The products in the metric within each block.
    within: Vec<Matrix>,
    /// The price of one coefficient: half the logarithm of the number of values (Schwarz, Annals of Statistics 6 (1978)
    /// 461).
    pub price: f64,
}

/// A block that was chosen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::gap) struct Chosen {
    pub block: usize,
    /// The gain in log-likelihood, and the same minus the price.
    pub gain: f64,
    pub criterion: f64,
}

/// State of a selection: all blocks, orthogonal to those that were chosen.
#[derive(Clone)]
pub(in crate::gap) struct Left {
    /// Orthonormal directions of the chosen blocks, with their products in the metric.
    taken: Vec<(Vec<f64>, Vec<f64>)>,
    within: Vec<Matrix>,
    /// The products of all rows with each of these directions.
    along: Vec<Vec<f64>>,
}

impl<'a> Blocks<'a> {
    pub fn new(
        metric: &'a Metric,
        rows: &'a Matrix,
        blocks: &'a [Vec<usize>],
        values: usize,
    ) -> Self {
        let lengths: Vec<Vec<f64>> = blocks
            .iter()
            .map(|own| own.iter().flat_map(|&a| metric.of(rows.row(a))).collect())
            .collect();
        let n = rows.columns();
        let mut squares = vec![0.0; rows.rows()];
        let within = blocks.iter().zip(&lengths).map(|(own, rest)| {
            Matrix::from_fn(own.len(), own.len(), |k, l| {
                dot(rows.row(own[k]), &rest[l * n..(l + 1) * n])
            })
        });
        let within: Vec<Matrix> = within.collect();
        for (own, gram) in blocks.iter().zip(&within) {
            own.iter().enumerate().for_each(|(k, &a)| squares[a] = gram[(k, k)].max(0.0));
        }
        let price = 0.5 * (values.max(2) as f64).ln();
        Self { metric, rows, squares, members: blocks, within, price }
    }

    pub fn whole(&self) -> Left {
        Left { taken: Vec::new(), within: self.within.clone(), along: Vec::new() }
    }

    /// The product of each row with a residual.
    pub fn scores(&self, residual: &[f64]) -> Vec<f64> {
        multiply_vector(self.rows, residual)
    }

    /// The products of each row with several residuals, `residuals x rows`; the residuals are one per row.
    pub fn scores_of(&self, residuals: &Matrix) -> Matrix {
        multiply_transposed(residuals, self.rows)
    }

    /// The block of best criterion in addition to those that were chosen, by the scores of a residual.
    pub fn best(&self, left: &Left, scores: &[f64], residual: &[f64]) -> Option<Chosen> {
        self.each(left, scores, residual).fold(None, |best: Option<Chosen>, next| match best {
            Some(best) if best.criterion >= next.criterion => Some(best),
            _ => Some(next),
        })
    }

    /// The gain of each block in addition to those that were chosen, without those that depend linearly on them.
    pub fn each(
        &self,
        left: &Left,
        scores: &[f64],
        residual: &[f64],
    ) -> impl Iterator<Item = Chosen> {
        let onto: Vec<f64> = left.taken.iter().map(|(u, _)| dot(u, residual)).collect();
        let gain = move |(block, own): (usize, &Vec<usize>)| {
            let gram = &left.within[block];
            let says = |(k, &a): (usize, &usize)| {
                self.squares[a] > 0.0 && gram[(k, k)] > OWN * self.squares[a]
            };
            if !own.iter().enumerate().all(says) {
                return None;
            }
            let factor = Cholesky::new(gram).ok()?;
            let rest = |&a: &usize| {
                let taken = left.along.iter().zip(&onto).map(|(along, o)| along[a] * o);
                scores[a] - taken.sum::<f64>()
            };
            let mut score: Vec<f64> = own.iter().map(rest).collect();
            factor.whiten(&mut score);
            let gain = 0.5 * dot(&score, &score);
            Some(Chosen { block, gain, criterion: gain - self.price * own.len() as f64 })
        };
        self.members.iter().enumerate().filter_map(gain)
    }

    /// Adds a block to those that were chosen, and makes all others orthogonal to it.
    pub fn take(&self, left: &mut Left, block: usize) {
        for &a in &self.members[block] {
            let mut direction = self.rows.row(a).to_vec();
            for ((u, _), along) in left.taken.iter().zip(&left.along) {
                add_scaled(&mut direction, -along[a], u);
            }
            let rest = self.metric.of(&direction);
            let length = dot(&direction, &rest).max(f64::MIN_POSITIVE).sqrt();
            let unit = |x: Vec<f64>| x.into_iter().map(|x| x / length).collect::<Vec<f64>>();
            let (direction, rest) = (unit(direction), unit(rest));
            let along = multiply_vector(self.rows, &rest);
            for (own, gram) in self.members.iter().zip(&mut left.within) {
                for (k, &a) in own.iter().enumerate() {
                    for (l, &b) in own.iter().enumerate() {
                        gram[(k, l)] -= along[a] * along[b];
                    }
                }
            }
            left.taken.push((direction, rest));
            left.along.push(along);
        }
    }

    /// The log-likelihood gained by choosing the best `steps` blocks one after another.
    pub fn gained(&self, residual: &[f64], steps: usize) -> f64 {
        let (mut left, scores) = (self.whole(), self.scores(residual));
        let mut gained = 0.0;
        for _ in 0..steps {
            let Some(best) = self.best(&left, &scores, residual) else { break };
            gained += best.gain;
            self.take(&mut left, best.block);
        }
        gained
    }

    /// The coefficients of chosen blocks in a joint fit and their standard deviations, in the order of their rows.
    pub fn coefficients(&self, chosen: &[usize], residual: &[f64]) -> Option<(Vec<f64>, Vec<f64>)> {
        let own: Vec<usize> =
            chosen.iter().flat_map(|&b| self.members[b].iter().copied()).collect();
        let rest: Vec<Vec<f64>> = own.iter().map(|&a| self.metric.of(self.rows.row(a))).collect();
        let gram =
            Matrix::from_fn(own.len(), own.len(), |k, l| dot(self.rows.row(own[k]), &rest[l]));
        let factor = Cholesky::new(&gram).ok()?;
        let mut values: Vec<f64> = own.iter().map(|&a| dot(self.rows.row(a), residual)).collect();
        factor.solve(&mut values);
        let inverse = factor.inverse();
        let sd = (0..own.len()).map(|k| inverse[(k, k)].sqrt()).collect();
        Some((values, sd))
    }
}
