//! Bayesian compressive sensing: each weight has a normal prior of its own unknown variance, most of which become
//! zero where the marginal likelihood is largest.
//!
//! The ascent is that of Tipping and Faul (2003): at each step the one term whose variance changes the
//! marginal likelihood most enters, changes or leaves. The variance of the noise is not known; it is tried
//! from large to small, and the terms of least error are taken.

use lacuna::linalg::{Matrix, vector};

use super::dictionary::{ActiveSet, Dictionary};
use super::judge::{Choice, Criterion, judged};

/// The ascent ends when no step gains more than this in twice the log marginal likelihood.
const GAIN: f64 = 1e-4;
/// Variances of the noise that were worse in a row before the search among them ends.
const WORSE: usize = 3;
/// The least share of the output's variance that noise is taken to have, as a power of ten.
const LEAST_NOISE: i32 = 14;

/// The best set of terms for an output, given as its values less their mean and their products with the
/// dictionary's columns.
pub(super) fn bayesian(
    dictionary: &Dictionary,
    centred: &[f64],
    correlations: &[f64],
    criterion: &Criterion,
) -> Option<Choice> {
    let variance = vector::dot(centred, centred) / centred.len() as f64;
    let mut best: Option<Choice> = None;
    let mut worse = 0;
    for power in 1..=LEAST_NOISE {
        let noise = variance * 10.0_f64.powi(-power);
        let terms = Ascent::new(dictionary, correlations, noise).run(dictionary.most_terms());
        let mut set = ActiveSet::new(dictionary);
        for term in terms {
            set.enter(term);
        }
        if set.terms().is_empty() {
            continue;
        }
        if Choice::improve(&mut best, judged(&set, centred, criterion)) {
            worse = 0;
        } else {
            worse += 1;
        }
        if worse >= WORSE {
            break;
        }
    }
    best
}

/// The posterior of the active weights and the two statistics of every term, in the notation of Tipping and
/// Faul: `S = phi' C^-1 phi` and `Q = phi' C^-1 y` with `C` the covariance of the output.
struct Ascent<'a> {
    dictionary: &'a Dictionary,
    open: Vec<bool>,
    /// The noise's precision.
    beta: f64,
    active: Vec<usize>,
    /// The precision of each active weight's prior.
    alpha: Vec<f64>,
    mean: Vec<f64>,
    covariance: Matrix,
    s: Vec<f64>,
    q: Vec<f64>,
    scratch: Vec<f64>,
}

/// A change of one term.
enum Change {
    Enter { term: usize, alpha: f64 },
    Set { place: usize, alpha: f64 },
    Leave { place: usize },
}

impl<'a> Ascent<'a> {
    fn new(dictionary: &'a Dictionary, correlations: &[f64], noise: f64) -> Self {
        let beta = noise.recip();
        Self {
            dictionary,
            open: dictionary.varies().collect(),
            beta,
            active: Vec::new(),
            alpha: Vec::new(),
            mean: Vec::new(),
            covariance: Matrix::zeros(0, 0),
            s: vec![beta; correlations.len()],
            q: correlations.iter().map(|c| beta * c).collect(),
            scratch: vec![0.0; correlations.len()],
        }
    }

    /// Ascends to the maximum; the active terms there.
    fn run(mut self, most: usize) -> Vec<usize> {
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
        self.active
    }

    /// The change that gains most.
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
        let gram = self.dictionary.gram();
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

    /// Takes `size` times the outer product of column `place` off the covariance.
    fn shrink(&mut self, place: usize, size: f64) {
        let column = self.covariance.column(place);
        let mean = self.mean[place];
        let weights: Vec<f64> = column.iter().map(|x| self.beta * x).collect();
        let gram = self.dictionary.gram();
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
