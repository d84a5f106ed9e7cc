//! Runs and emulator of a study with parameters by group: trained once on the parameters of the model, evaluated once for each
//! group.
//!
//! What follows the training sees runs in which all groups have the same values, as they were made: every run has one row with
//! the value of the model's parameter in the column of each group, and the same response in the scenarios of each.

mod numerics;
mod runs;

use lacuna::plugin::forward::Linear;
use lacuna::plugin::surrogate::{FitError, Indices, Tables};
use lacuna::plugin::{Emulator, Fact, Forward, Sensitivity};
use lacuna::run::{Stop, files};
use lacuna_linalg::Matrix;
use lacuna_run::Kept;
use serde_json::json;

use super::read::Data;
use super::surrogate::Fitted;
use crate::study::Study;
use crate::study::hierarchy::{Part, Trained};

pub use numerics::{numerical_error, of_model};

/// A fitted surrogate with its emulator.
type Learned = (Kept<Fitted>, Box<dyn Emulator>);

/// Runs, fitted surrogate and emulator of a study, from those of the study that is trained.
pub fn by_group(
    study: &Study,
    data: Kept<Data>,
    (fitted, emulator): Learned,
) -> (Kept<Data>, Learned) {
    let Some(trained) = &study.hierarchy.trained else { return (data, (fitted, emulator)) };
    let emulator = each_group(study, emulator);
    let ensemble = data.value.ensemble.map(|own| runs::ensemble(study, trained, own));
    let data = Kept { value: Data { ensemble, ..data.value }, ..data };
    // The same emulator with other groups is another map.
    let hash = hash(study, trained, &fitted.hash);
    let fitted = Kept { value: runs::fitted(study, trained, fitted.value), hash, ..fitted };
    (data, (fitted, emulator))
}

/// Hash of what was learnt from the runs, with the groups.
fn hash(study: &Study, trained: &Trained, own: &str) -> String {
    files::hash(json!([own, study.parameters.len(), trained.parts]).to_string().as_bytes())
}

/// The emulator of a study, from that of the study that is trained.
pub fn each_group(study: &Study, emulator: Box<dyn Emulator>) -> Box<dyn Emulator> {
    let Some(trained) = &study.hierarchy.trained else { return emulator };
    let spread = Spread::of(study, trained);
    let coefficients = emulator.linear().map(|linear| spread.coefficients(linear.coefficients()));
    let own = emulator.fit_error();
    let fit_error = FitError {
        relative: spread.curve(&own.relative),
        residuals: spread.curves(&own.residuals),
    };
    Box::new(Grouped { emulator, spread, coefficients, fit_error })
}

/// Correspondence between the inputs and outputs of the model and those of a study.
struct Spread {
    parts: Vec<Part>,
    dimension: usize,
    outputs: usize,
}

impl Spread {
    fn of(study: &Study, trained: &Trained) -> Self {
        let (dimension, outputs) = (study.parameters.len(), study.layouts.len());
        Self { parts: trained.parts.clone(), dimension, outputs }
    }

    /// Values by output of the study; none if there are none by output of the model.
    fn curve<T: Copy + Default>(&self, own: &[T]) -> Vec<T> {
        if own.is_empty() {
            return Vec::new();
        }
        let mut all = vec![T::default(); self.outputs];
        for (from, to) in self.parts.iter().flat_map(|part| &part.outputs) {
            all[to.clone()].copy_from_slice(&own[from.clone()]);
        }
        all
    }

    /// Curves by output of the study, one per row.
    fn curves(&self, own: &Matrix) -> Matrix {
        Matrix::from_rows(self.outputs, own.iter_rows().map(|row| self.curve(row)))
    }

    /// Evaluates a function of the model's inputs for each group: `points x outputs`.
    fn each(&self, points: &Matrix, value: impl Fn(&Matrix) -> Matrix) -> Matrix {
        let mut all = Matrix::zeros(points.rows(), self.outputs);
        for part in &self.parts {
            let own = value(&points.select_columns(&part.parameters));
            for i in 0..points.rows() {
                for (from, to) in &part.outputs {
                    all.row_mut(i)[to.clone()].copy_from_slice(&own.row(i)[from.clone()]);
                }
            }
        }
        all
    }

    /// Numbers by output and parameter of the model as `outputs x parameters` of the study.
    fn by_parameter(&self, own: impl Fn(&Part) -> Matrix) -> Matrix {
        let mut all = Matrix::zeros(self.outputs, self.dimension);
        for part in &self.parts {
            let slopes = own(part);
            for (from, to) in &part.outputs {
                for (i, k) in from.clone().zip(to.clone()) {
                    for (column, &j) in part.parameters.iter().enumerate() {
                        all[(k, j)] = slopes[(i, column)];
                    }
                }
            }
        }
        all
    }

    /// The coefficients of one basis for each group, `(groups x terms) x outputs`.
    fn coefficients(&self, own: &Matrix) -> Matrix {
        let mut all = Matrix::zeros(self.parts.len() * own.rows(), self.outputs);
        for (group, part) in self.parts.iter().enumerate() {
            for term in 0..own.rows() {
                let row = all.row_mut(group * own.rows() + term);
                for (from, to) in &part.outputs {
                    row[to.clone()].copy_from_slice(&own.row(term)[from.clone()]);
                }
            }
        }
        all
    }

    fn point(part: &Part, point: &[f64]) -> Vec<f64> {
        part.parameters.iter().map(|&j| point[j]).collect()
    }
}

/// One emulator evaluated at the values of each group.
struct Grouped {
    emulator: Box<dyn Emulator>,
    spread: Spread,
    /// Coefficients of all groups, if the emulator is linear.
    coefficients: Option<Matrix>,
    fit_error: FitError,
}

impl Forward for Grouped {
    fn dimension(&self) -> usize {
        self.spread.dimension
    }

    fn outputs(&self) -> usize {
        self.spread.outputs
    }

    fn mean(&self, points: &Matrix) -> Matrix {
        self.spread.each(points, |own| self.emulator.mean(own))
    }

    fn variance(&self, points: &Matrix) -> Option<Matrix> {
        let first = self.spread.parts.first()?;
        let one = points.select_rows(&[0]).select_columns(&first.parameters);
        self.emulator.variance(&one)?;
        let nothing = |own: &Matrix| Matrix::zeros(own.rows(), self.emulator.outputs());
        let variance = |own: &Matrix| self.emulator.variance(own).unwrap_or_else(|| nothing(own));
        Some(self.spread.each(points, variance))
    }

    fn jacobian(&self, point: &[f64]) -> Matrix {
        self.spread.by_parameter(|part| self.emulator.jacobian(&Spread::point(part, point)))
    }

    fn linear(&self) -> Option<&dyn Linear> {
        self.coefficients.as_ref().map(|_| self as &dyn Linear)
    }

    fn failure(&self) -> Option<String> {
        self.emulator.failure()
    }
}

/// The basis of each group beside the others.
impl Linear for Grouped {
    fn coefficients(&self) -> &Matrix {
        static NOTHING: std::sync::OnceLock<Matrix> = std::sync::OnceLock::new();
        self.coefficients.as_ref().unwrap_or_else(|| NOTHING.get_or_init(Matrix::default))
    }

    fn basis(&self, points: &Matrix) -> Matrix {
        let Some(linear) = self.emulator.linear() else { return Matrix::default() };
        let of = |part: &Part| linear.basis(&points.select_columns(&part.parameters));
        let parts: Vec<Matrix> = self.spread.parts.iter().map(of).collect();
        let width = parts.iter().map(Matrix::columns).sum();
        let row = |i: usize| parts.iter().flat_map(|part| part.row(i).to_vec()).collect::<Vec<_>>();
        Matrix::from_rows(width, (0..points.rows()).map(row))
    }

    fn basis_gradient(&self, point: &[f64]) -> Matrix {
        let Some(linear) = self.emulator.linear() else { return Matrix::default() };
        let mut all = Matrix::zeros(0, self.spread.dimension);
        for part in &self.spread.parts {
            for slopes in linear.basis_gradient(&Spread::point(part, point)).iter_rows() {
                let mut row = vec![0.0; self.spread.dimension];
                part.parameters.iter().zip(slopes).for_each(|(&j, slope)| row[j] = *slope);
                all.push_row(&row);
            }
        }
        all
    }
}

impl Emulator for Grouped {
    fn sensitivity(&self) -> Option<Sensitivity> {
        let own = self.emulator.sensitivity()?;
        let spread = &self.spread;
        let width = own.pairs.len();
        let pairs: Vec<[usize; 2]> = spread
            .parts
            .iter()
            .flat_map(|part| own.pairs.iter().map(|pair| pair.map(|j| part.parameters[j])))
            .collect();
        let mut of_pairs = Matrix::zeros(spread.outputs, pairs.len());
        for (group, part) in spread.parts.iter().enumerate() {
            for (from, to) in &part.outputs {
                for (i, k) in from.clone().zip(to.clone()) {
                    of_pairs.row_mut(k)[group * width..][..width]
                        .copy_from_slice(own.outputs.pairs.row(i));
                }
            }
        }
        let outputs = Indices {
            first: spread.by_parameter(|_| own.outputs.first.clone()),
            total: spread.by_parameter(|_| own.outputs.total.clone()),
            pairs: of_pairs,
        };
        let variance = spread.curve(&own.variance);
        let whole: f64 = variance.iter().sum();
        let weighted = |indices: &Matrix| {
            let of = |j: usize| -> f64 {
                let each = variance.iter().enumerate();
                each.map(|(k, v)| v * indices[(k, j)]).sum::<f64>() / whole.max(f64::MIN_POSITIVE)
            };
            Matrix::from_fn(1, indices.columns(), |_, j| of(j))
        };
        let aggregated = Indices {
            first: weighted(&outputs.first),
            total: weighted(&outputs.total),
            pairs: weighted(&outputs.pairs),
        };
        Some(Sensitivity { mean: spread.curve(&own.mean), variance, pairs, outputs, aggregated })
    }

    fn fit_error(&self) -> &FitError {
        &self.fit_error
    }

    fn facts(&self) -> Vec<Fact> {
        let mut facts = self.emulator.facts();
        facts.push(Fact::new("evaluations of the emulator per draw", self.spread.parts.len()));
        facts
    }

    fn save(&self) -> Result<Vec<u8>, Stop> {
        self.emulator.save()
    }

    fn tables(&self) -> Result<Tables, String> {
        Err("each group has parameters of its own, which share one emulator".to_owned())
    }
}

#[cfg(test)]
mod tests;
