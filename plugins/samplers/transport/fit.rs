//! Location and scale of one coordinate given those before it, from draws.

use lacuna_linalg::vector::dot;
use lacuna_linalg::{Cholesky, Matrix, multiply_vector};

use super::map::{Form, Place};

/// Rounds in which location and scale are fitted in turn, and steps of a fit of the scale.
const ROUNDS: usize = 3;
const SCORING_STEPS: usize = 25;
/// Penalty on the coefficients, as a part of the diagonal of the normal equations.
const RIDGE: f64 = 1e-6;
/// Size of a coefficient in its standard errors below which the term is left out: a location that is wrong by chance is many
/// scales wide where the scale is small.
const SURE: f64 = 4.0;
/// Blocks of consecutive steps of a chain within which draws depend on each other, in the standard errors.
const BLOCKS: usize = 10;
/// Gain in the log density of a draw that was not used in the fit, from which a richer form is taken.
const GAIN: f64 = 0.01;

/// Draws of one coordinate and of those on which it may depend.
pub(super) struct Dependence<'a> {
    /// Values of the others, by draw in the order in which they were made.
    pub given: &'a [Vec<f64>],
    /// Values of the coordinate.
    pub values: &'a [f64],
    /// Number of chains, whose draws follow each other step by step.
    pub chains: usize,
    /// True if the location may have products of the others.
    pub products: bool,
}

/// Location and scale of a coordinate, and the gain in its mean log density over those without dependence; `None` if they cannot be
/// fitted.
///
/// Of the three forms it is the simplest that predicts one half of the draws from the other about as well as the best.
pub(super) fn place(dependence: &Dependence<'_>) -> Option<(Place, f64)> {
    let predicts = |form: Form| -> Option<f64> {
        let [early, late] = dependence.halves();
        Some(0.5 * (late.density(&early.fitted(form)?) + early.density(&late.fitted(form)?)))
    };
    let alone = predicts(Form::Constant)?;
    let mut best = (Form::Constant, alone);
    let others = dependence.given.first().map_or(0, Vec::len);
    let richer: &[Form] = if others == 0 { &[] } else { &[Form::Linear, Form::Curved] };
    for &form in richer {
        match predicts(form) {
            Some(score) if score > best.1 + GAIN => best = (form, score),
            _ => {}
        }
    }
    Some((dependence.fitted(best.0)?, best.1 - alone))
}

impl Dependence<'_> {
    fn halves(&self) -> [Dependence<'_>; 2] {
        let middle = self.values.len() / (2 * self.chains) * self.chains;
        let (early, late) = self.given.split_at(middle);
        let (first, last) = self.values.split_at(middle);
        [(early, first), (late, last)].map(|(given, values)| Dependence { given, values, ..*self })
    }

    /// Mean log density of the coordinate, up to a constant.
    fn density(&self, place: &Place) -> f64 {
        let draws = self.given.iter().zip(self.values);
        let sum: f64 = draws
            .map(|(v, value)| {
                let (location, log_scale) = place.at(v, self.products);
                -log_scale - 0.5 * ((value - location) * (-log_scale).exp()).powi(2)
            })
            .sum();
        let mean = sum / self.values.len() as f64;
        if mean.is_finite() { mean } else { f64::NEG_INFINITY }
    }

    fn fitted(&self, form: Form) -> Option<Place> {
        let terms = |v: &Vec<f64>| Place::location_terms(form, v, self.products);
        let location: Vec<Vec<f64>> = self.given.iter().map(terms).collect();
        let scale: Vec<Vec<f64>> = self.given.iter().map(|v| Place::scale_terms(form, v)).collect();
        let mut locations = Terms::all(&location);
        let mut scales = Terms::all(&scale);
        loop {
            let blocks = Blocks { draws: self.values.len(), chains: self.chains };
            let terms = (&locations.of(&location)[..], &scales.of(&scale)[..]);
            let fit = alternate(terms, self.values, blocks)?;
            let fewer = (locations.sure(&fit.location), scales.sure(&fit.log_scale));
            if fewer == (locations.clone(), scales.clone()) {
                return Some(Place {
                    form,
                    location: locations.spread(&fit.location),
                    log_scale: scales.spread(&fit.log_scale),
                });
            }
            (locations, scales) = fewer;
        }
    }
}

/// Terms that are in a fit, out of all.
#[derive(Debug, Clone, PartialEq)]
struct Terms {
    kept: Vec<usize>,
    all: usize,
}

/// Coefficients with their standard errors.
type Coefficients = Vec<(f64, f64)>;

impl Terms {
    fn all(rows: &[Vec<f64>]) -> Self {
        let all = rows.first().map_or(0, Vec::len);
        Self { kept: (0..all).collect(), all }
    }

    fn of(&self, rows: &[Vec<f64>]) -> Vec<Vec<f64>> {
        rows.iter().map(|row| self.kept.iter().map(|&t| row[t]).collect()).collect()
    }

    /// The constant, and the terms whose coefficients are sure.
    fn sure(&self, coefficients: &Coefficients) -> Self {
        let terms = self.kept.iter().zip(coefficients);
        let sure = terms.filter(|(t, (c, error))| **t == 0 || c.abs() > SURE * error);
        Self { kept: sure.map(|(t, _)| *t).collect(), all: self.all }
    }

    fn spread(&self, coefficients: &Coefficients) -> Vec<f64> {
        let mut all = vec![0.0; self.all];
        self.kept.iter().zip(coefficients).for_each(|(&t, &(c, _))| all[t] = c);
        all
    }
}

/// A fit of some terms.
struct Fit {
    location: Coefficients,
    log_scale: Coefficients,
}

/// Groups of draws that depend on each other.
#[derive(Clone, Copy)]
struct Blocks {
    draws: usize,
    chains: usize,
}

impl Blocks {
    fn of(self, draw: usize) -> usize {
        let steps = self.draws.div_ceil(self.chains);
        (draw / self.chains) * BLOCKS / steps * self.chains + draw % self.chains
    }

    /// Coefficients with their errors by leaving out one block after the other: what rests on one block is not sure.
    ///
    /// `weights` are those of the normal equations, `scores` the derivatives of the log likelihood of each draw by the linear
    /// predictor.
    fn with_errors(
        self,
        coefficients: &[f64],
        rows: &[Vec<f64>],
        weights: &[f64],
        scores: &[f64],
    ) -> Option<Coefficients> {
        let p = coefficients.len();
        let whole = gram((0..rows.len()).map(|i| (&rows[i], weights[i])), p);
        let mut squares = vec![0.0; p];
        for block in 0..BLOCKS * self.chains {
            let own = || (0..rows.len()).filter(|&i| self.of(i) == block);
            let part = gram(own().map(|i| (&rows[i], weights[i])), p);
            let mut sum = vec![0.0; p];
            for i in own() {
                sum.iter_mut().zip(&rows[i]).for_each(|(to, x)| *to += scores[i] * x);
            }
            let rest = Matrix::from_fn(p, p, |i, j| whole[(i, j)] - part[(i, j)]);
            let moved = multiply_vector(&inverse(rest)?, &sum);
            squares.iter_mut().zip(&moved).for_each(|(to, x)| *to += x * x);
        }
        Some(coefficients.iter().zip(squares).map(|(c, square)| (*c, square.sqrt())).collect())
    }
}

/// Location and scale in turn, each given the other.
fn alternate(
    (of_location, of_scale): (&[Vec<f64>], &[Vec<f64>]),
    values: &[f64],
    blocks: Blocks,
) -> Option<Fit> {
    let mut log_scale = vec![0.0; of_scale.first().map_or(1, Vec::len)];
    let mut location = Vec::new();
    let (mut weights, mut residuals) = (Vec::new(), Vec::new());
    for _ in 0..ROUNDS {
        weights = of_scale.iter().map(|t| (-2.0 * dot(&log_scale, t)).exp()).collect();
        location = least_squares(of_location, values, &weights)?;
        residuals = of_location.iter().zip(values).map(|(t, v)| v - dot(&location, t)).collect();
        log_scale = scales(of_scale, &residuals, log_scale)?;
    }
    let of_places: Vec<f64> = residuals.iter().zip(&weights).map(|(r, w)| w * r).collect();
    let of_sizes: Vec<f64> = (of_scale.iter().zip(&residuals))
        .map(|(t, r)| r * r * (-2.0 * dot(&log_scale, t)).exp() - 1.0)
        .collect();
    let twice = vec![2.0; values.len()];
    Some(Fit {
        location: blocks.with_errors(&location, of_location, &weights, &of_places)?,
        log_scale: blocks.with_errors(&log_scale, of_scale, &twice, &of_sizes)?,
    })
}

/// Sum of the products of rows with themselves, weighted.
fn gram<'a>(rows: impl Iterator<Item = (&'a Vec<f64>, f64)>, p: usize) -> Matrix {
    let mut all = Matrix::zeros(p, p);
    for (row, w) in rows {
        for i in 0..p {
            for j in 0..=i {
                all[(i, j)] += w * row[i] * row[j];
            }
        }
    }
    for i in 0..p {
        for j in 0..i {
            all[(j, i)] = all[(i, j)];
        }
    }
    all
}

/// The inverse of a sum of products, with a penalty in units of its diagonal.
fn inverse(mut sum: Matrix) -> Option<Matrix> {
    for i in 0..sum.rows() {
        let penalty = RIDGE * sum[(i, i)] + f64::MIN_POSITIVE;
        sum[(i, i)] += penalty;
    }
    Some(Cholesky::new(&sum).ok()?.inverse())
}

fn least_squares(rows: &[Vec<f64>], values: &[f64], weights: &[f64]) -> Option<Vec<f64>> {
    let p = rows.first().map_or(0, Vec::len);
    let mut right = vec![0.0; p];
    for ((row, value), w) in rows.iter().zip(values).zip(weights) {
        right.iter_mut().zip(row).for_each(|(to, x)| *to += w * value * x);
    }
    let sum = gram(rows.iter().zip(weights.iter().copied()), p);
    Some(multiply_vector(&inverse(sum)?, &right))
}

/// Coefficients of the logarithm of the scale of normal residuals, by Fisher scoring.
fn scales(rows: &[Vec<f64>], residuals: &[f64], mut coefficients: Vec<f64>) -> Option<Vec<f64>> {
    let inverse = inverse(gram(rows.iter().map(|row| (row, 2.0)), coefficients.len()))?;
    for _ in 0..SCORING_STEPS {
        let mut slope = vec![0.0; coefficients.len()];
        for (row, r) in rows.iter().zip(residuals) {
            let by = 1.0 - r * r * (-2.0 * dot(&coefficients, row)).exp();
            slope.iter_mut().zip(row).for_each(|(to, x)| *to += by * x);
        }
        let step = multiply_vector(&inverse, &slope);
        // Far from the maximum a whole step may overshoot.
        let size = step.iter().fold(0.0_f64, |most, s| most.max(s.abs()));
        let part = if size > 1.0 { 1.0 / size } else { 1.0 };
        coefficients.iter_mut().zip(&step).for_each(|(a, s)| *a -= part * s);
        if size < 1e-8 {
            break;
        }
    }
    coefficients.iter().all(|a| a.is_finite()).then_some(coefficients)
}
