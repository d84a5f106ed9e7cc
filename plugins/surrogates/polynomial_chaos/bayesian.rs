//! Bayesian compressive sensing: each weight has a normal prior with its own unknown variance, most of which are zero
//! where the marginal likelihood is largest.
//!
//! The ascent is that of Tipping and Faul (2003): at each step the one term whose variance changes the marginal
//! likelihood most enters, is updated or leaves. The variance of the noise is unknown; it is tried from large to
//! small values, and that with the smallest cross-validation error of the posterior mean is taken.

use std::sync::OnceLock;

use lacuna::math::random::{Stream, permutation};
use lacuna_linalg::{Matrix, gram, vector};

use super::dictionary::{ActiveSet, Dictionary};
use super::judge::{Choice, Criterion, judged};

/// Gain in twice the log marginal likelihood below which the ascent ends.
const GAIN: f64 = 1e-4;
/// Number of consecutive noise variances that were worse than the best before the search among them ends.
const WORSE: usize = 2;
/// Smallest fraction of the output's variance that is tried for the noise, as a negative power of ten.
const LEAST_NOISE: i32 = 14;
/// Number of folds of the cross-validation that finds the noise.
const PARTS: usize = 5;

/// The folds of runs shared by all outputs, with the Gram matrices of the other runs.
#[derive(Default)]
pub(super) struct Parts(OnceLock<Vec<Part>>);

struct Part {
    runs: Vec<usize>,
    /// The dictionary's columns at these runs (`runs x terms`).
    columns: Matrix,
    gram: Matrix,
}

impl Parts {
    fn of(&self, dictionary: &Dictionary) -> &[Part] {
        self.0.get_or_init(|| {
            let columns = dictionary.columns().transposed();
            let order =
                permutation(&mut Stream::root(0).named("parts").generator(), columns.rows());
            let part = |first: usize| {
                let runs: Vec<usize> = order.iter().copied().skip(first).step_by(PARTS).collect();
                let own = columns.select_rows(&runs);
                let mut others = dictionary.gram().into_owned();
                let squares = gram(&own);
                vector::add_scaled(others.as_mut_slice(), -1.0, squares.as_slice());
                Part { runs, columns: own, gram: others }
            };
            (0..PARTS).map(part).collect()
        })
    }
}

impl Part {
    /// Returns the sum of squared residuals of these runs for a fit to the other runs.
    fn error(&self, open: &[bool], centred: &[f64], all: &[f64], noise: f64, most: usize) -> f64 {
        let own: Vec<f64> = self.runs.iter().map(|&i| centred[i]).collect();
        let mut correlations = all.to_vec();
        for (row, y) in self.columns.iter_rows().zip(&own) {
            vector::add_scaled(&mut correlations, -y, row);
        }
        let posterior = Ascent::new(&self.gram, open, &correlations, noise).run(most);
        let left = |(row, y): (&[f64], &f64)| {
            let terms = posterior.mean.iter().zip(&posterior.active);
            let model: f64 = terms.map(|(mean, &t)| mean * row[t]).sum();
            (y - model).powi(2)
        };
        self.columns.iter_rows().zip(&own).map(left).sum()
    }
}

/// Chooses the terms of an output, given as its values minus their mean (`centred`) and their products with the
/// dictionary's columns (`correlations`).
pub(super) fn bayesian(
    dictionary: &Dictionary,
    parts: &Parts,
    centred: &[f64],
    correlations: &[f64],
    criterion: &Criterion,
) -> Option<Choice> {
    let variance = vector::dot(centred, centred) / centred.len() as f64;
    let (open, most): (Vec<bool>, _) =
        (dictionary.varies().collect(), dictionary.most_greedy_terms());
    let parts = parts.of(dictionary);
    let (mut noise, mut least, mut worse) = (0.1 * variance, f64::INFINITY, 0);
    for power in 1..=LEAST_NOISE {
        let tried = variance * 10.0_f64.powi(-power);
        let error: f64 =
            parts.iter().map(|part| part.error(&open, centred, correlations, tried, most)).sum();
        if error < least {
            (noise, least, worse) = (tried, error, 0);
        } else {
            worse += 1;
        }
        if worse >= WORSE {
            break;
        }
    }
    let mut set = ActiveSet::new(dictionary);
    for term in Ascent::new(&dictionary.gram(), &open, correlations, noise).run(most).active {
        set.enter(term);
    }
    if set.terms().is_empty() {
        // No term rises above the noise; the strongest one is taken, because an output that varies needs a term.
        let size = |t: &usize| correlations[*t].abs();
        let strongest =
            (0..open.len()).filter(|&t| open[t]).max_by(|a, b| size(a).total_cmp(&size(b)))?;
        set.enter(strongest);
    }
    Some(judged(set, centred, criterion))
}

/// Posterior of the active weights and the two statistics of every term, in the notation of Tipping and Faul:
/// `S = phi' C^-1 phi` and `Q = phi' C^-1 y` with `C` the covariance of the output.
pub(super) struct Ascent<'a> {
    gram: &'a Matrix,
    open: &'a [bool],
    /// Precision of the noise.
    beta: f64,
    pub active: Vec<usize>,
    /// Precision of each active weight's prior.
    pub alpha: Vec<f64>,
    /// Posterior mean of each active weight.
    pub mean: Vec<f64>,
    covariance: Matrix,
    s: Vec<f64>,
    q: Vec<f64>,
    scratch: Vec<f64>,
}

/// Change of one term of the model.
enum Change {
    Enter { term: usize, alpha: f64 },
    Set { place: usize, alpha: f64 },
    Leave { place: usize },
}

impl<'a> Ascent<'a> {
    /// Starts the ascent without active terms, from the Gram matrix of the columns, flags of those that may enter,
    /// and their products with the output.
    pub fn new(gram: &'a Matrix, open: &'a [bool], correlations: &[f64], noise: f64) -> Self {
        let beta = noise.recip();
        Self {
            gram,
            open,
            beta,
            active: Vec::new(),
            alpha: Vec::new(),
            mean: Vec::new(),
            covariance: Matrix::zeros(0, 0),
            s: (0..correlations.len()).map(|t| beta * gram[(t, t)]).collect(),
            q: correlations.iter().map(|c| beta * c).collect(),
            scratch: vec![0.0; correlations.len()],
        }
    }

    /// Ascends to the maximum, or until `most` weights are active.
    pub fn run(mut self, most: usize) -> Self {
        for _ in 0..20 * most.max(1) {
            let Some((gain, change)) = self.best() else { break };
            let full = self.active.len() >= most;
            if gain < GAIN || (full && matches!(change, Change::Enter { .. })) {
                break;
            }
            match change {
                Change::Enter { term, alpha } => self.enter(term, alpha),
                Change::Set { place, alpha } => {
                    let rise = alpha - self.alpha[place];
                    self.alpha[place] = alpha;
                    let size = (self.covariance[(place, place)] + rise.recip()).recip();
                    self.shrink(place, size);
                }
                Change::Leave { place } => {
                    self.shrink(place, self.covariance[(place, place)].recip());
                    self.forget(place);
                }
            }
        }
        self
    }

    /// Returns the change with the largest gain.
    fn best(&self) -> Option<(f64, Change)> {
        let mut best: Option<(f64, Change)> = None;
        let mut offer = |gain: f64, change| {
            if gain.is_finite() && best.as_ref().is_none_or(|(most, _)| gain > *most) {
                best = Some((gain, change));
            }
        };
        let mut is_active = vec![None; self.s.len()];
        self.active.iter().enumerate().for_each(|(place, &t)| is_active[t] = Some(place));
        for term in (0..self.s.len()).filter(|&t| self.open[t]) {
            let (s, q) = (self.s[term], self.q[term]);
            let Some(place) = is_active[term] else {
                if q * q > s && s > 0.0 {
                    let gain = (q * q - s) / s + (s / (q * q)).ln();
                    offer(gain, Change::Enter { term, alpha: s * s / (q * q - s) });
                }
                continue;
            };
            let alpha = self.alpha[place];
            let (own_s, own_q) = (alpha * s / (alpha - s), alpha * q / (alpha - s));
            if own_q * own_q > own_s {
                let new = own_s * own_s / (own_q * own_q - own_s);
                let change = new.recip() - alpha.recip();
                if change != 0.0 {
                    let gain = q * q / (s + change.recip()) - (s * change).ln_1p();
                    offer(gain, Change::Set { place, alpha: new });
                }
            } else {
                let gain = q * q / (s - alpha) - (-s / alpha).ln_1p();
                offer(gain, Change::Leave { place });
            }
        }
        best
    }

    fn enter(&mut self, term: usize, alpha: f64) {
        let gram = self.gram;
        let own: Vec<f64> = self.active.iter().map(|&t| gram[(term, t)]).collect();
        let weights: Vec<f64> =
            self.covariance.iter_rows().map(|row| self.beta * vector::dot(row, &own)).collect();
        let variance = (alpha + self.s[term]).recip();
        let mean = variance * self.q[term];

        vector::combine_rows(gram, &self.active, &weights, &mut self.scratch);
        for (t, x) in self.scratch.iter().enumerate() {
            let outside = self.beta * (gram[(term, t)] - x);
            self.s[t] -= variance * outside * outside;
            self.q[t] -= mean * outside;
        }
        let k = self.active.len();
        let border = |i: usize| if i < k { -weights[i] } else { 1.0 };
        self.covariance = Matrix::from_fn(k + 1, k + 1, |i, j| {
            let before = if i < k && j < k { self.covariance[(i, j)] } else { 0.0 };
            before + variance * border(i) * border(j)
        });
        self.mean.push(0.0);
        self.mean.iter_mut().enumerate().for_each(|(i, m)| *m += mean * border(i));
        self.active.push(term);
        self.alpha.push(alpha);
    }

    /// Subtracts `size` times the outer product of column `place` from the covariance.
    fn shrink(&mut self, place: usize, size: f64) {
        let column = self.covariance.column(place);
        let mean = self.mean[place];
        let weights: Vec<f64> = column.iter().map(|x| self.beta * x).collect();
        let gram = self.gram;
        vector::combine_rows(gram, &self.active, &weights, &mut self.scratch);
        for (t, x) in self.scratch.iter().enumerate() {
            self.s[t] += size * x * x;
            self.q[t] += size * mean * x;
        }
        for (i, x) in column.iter().enumerate() {
            vector::add_scaled(self.covariance.row_mut(i), -size * x, &column);
            self.mean[i] -= size * mean * x;
        }
    }

    fn forget(&mut self, place: usize) {
        let kept: Vec<usize> = (0..self.active.len()).filter(|&i| i != place).collect();
        self.covariance = self.covariance.select_rows(&kept).select_columns(&kept);
        self.active.remove(place);
        self.alpha.remove(place);
        self.mean.remove(place);
    }
}
