//! Gaussian processes over the components of the outputs.

use lacuna::plugin::forward::Linear;
use lacuna::plugin::surrogate::{FitError, Processes, Tables};
use lacuna::plugin::{Emulator, Fact, Forward};
use lacuna::run::Stop;
use lacuna_linalg::{Matrix, multiply, transposed_multiply};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::field::{Choice, Field, Runs};
use super::kernel::Kernel;
use super::nearest::{Conditioned, Restored};
use super::regressors::{Regressors, Written};
use super::standard::{Standard, standardised};
use crate::surrogates::polynomial_chaos::bytes;

/// Number of points emulated at a time, so that their correlations stay in the cache.
const BLOCK: usize = 64;

/// The fitted surrogate: `y(x) = mean + sum_c t_c(x) loadings_c`, each score `t_c` a Gaussian process.
#[derive(Debug, Clone, PartialEq)]
pub struct Kriging {
    /// Name of the plugin that fitted it.
    pub plugin: &'static str,
    /// Correlation function of all fields.
    pub kernel: Kernel,
    /// Names of the parameters.
    pub names: Vec<String>,
    /// Standard variables of the parameters.
    pub standards: Vec<Standard>,
    /// Regressors from which the trends of the fields are built.
    pub regressors: Regressors,
    /// Gaussian processes of the components.
    pub fields: Vec<Field>,
    /// Parameters of the runs in physical units (`runs x parameters`).
    pub points: Matrix,
    /// Scores of the components (`runs x components`).
    pub scores: Matrix,
    /// Mean of each output over the runs, then the contribution of one unit of each score
    /// (`(1 + components) x outputs`).
    pub loadings: Matrix,
    /// Mean square of the part of each output that the components leave out.
    pub truncation: Vec<f64>,
    /// Leave-one-out errors.
    pub fit_error: FitError,
}

/// All of a surrogate except its large arrays.
#[derive(Debug, Serialize, Deserialize)]
struct Header {
    kernel: Kernel,
    names: Vec<String>,
    standards: Vec<Standard>,
    regressors: Written,
    choices: Vec<Choice>,
    /// Results of conditioning on many runs; empty for exact processes.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    found: Vec<Restored>,
    runs: usize,
    components: usize,
    outputs: usize,
}

/// Conditions the processes of these choices on the runs; `None` if one of them cannot be computed.
pub fn condition(
    kernel: Kernel,
    choices: Vec<Choice>,
    standards: &[Standard],
    regressors: &Regressors,
    points: &Matrix,
    scores: &Matrix,
) -> Option<Vec<Field>> {
    let (points, regressors) = (standardised(standards, points), regressors.values(points));
    let runs = Runs { points: &points, regressors: &regressors, scores };
    choices.into_par_iter().map(|choice| Field::new(kernel, choice, runs)).collect()
}

impl Kriging {
    /// Calls `give` for blocks of points, with the index of the first point, their standard variables (one point per
    /// column) and their regressors.
    fn in_blocks(&self, points: &Matrix, mut give: impl FnMut(usize, &Matrix, &Matrix)) {
        for first in (0..points.rows()).step_by(BLOCK) {
            let rows: Vec<usize> = (first..points.rows().min(first + BLOCK)).collect();
            let block = points.select_rows(&rows);
            give(first, &standardised(&self.standards, &block), &self.regressors.values(&block));
        }
    }

    /// Loads the file that [`Emulator::save`] wrote; fails if it is damaged or from another plugin.
    pub fn from_bytes(plugin: &'static str, bytes: &[u8]) -> Result<Self, Stop> {
        let damaged = || bytes::damaged_as(plugin);
        let (header, mut numbers) = bytes::read_as::<Header>(plugin, bytes)?;
        let Header { kernel, names, standards, regressors, choices, .. } = header;
        let Header { found, runs, components, outputs, .. } = header;
        let d = standards.len();
        let shapes = [(runs, d), (runs, components), (components + 1, outputs), (1, outputs)];
        let mut shapes = [&shapes[..], &[(1, outputs), (runs, outputs)]].concat();
        if !found.is_empty() {
            shapes.extend([(components, runs), (choices.len(), runs)]);
        }
        let sizes: Option<Vec<usize>> = shapes.iter().map(|(m, n)| m.checked_mul(*n)).collect();
        let total = sizes
            .as_ref()
            .and_then(|sizes| sizes.iter().try_fold(0_usize, |sum, size| sum.checked_add(*size)));
        if d == 0 || names.len() != d || total != Some(numbers.len()) {
            return Err(damaged());
        }
        let mut parts = shapes.iter().map(|&(m, n)| Matrix::from_vec(m, n, numbers.next(m * n)));
        let mut part = || parts.next().ok_or_else(damaged);
        let (points, scores, loadings) = (part()?, part()?, part()?);
        let (truncation, relative) = (part()?.into_vec(), part()?.into_vec());
        let fit_error = FitError { relative, residuals: part()? };
        let regressors = regressors.read(&standards).ok_or_else(damaged)?;
        let sound = |choice: &Choice| {
            choice.length_scales.len() == d
                && choice.length_scales.iter().all(|l| *l > 0.0 && l.is_finite())
                && choice.terms.iter().all(|t| *t < regressors.count())
                && choice.components.iter().all(|c| *c < components)
        };
        if !choices.iter().all(sound) {
            return Err(damaged());
        }
        let fields = if found.is_empty() {
            condition(kernel, choices, &standards, &regressors, &points, &scores)
        } else {
            let (alpha, precisions) = (part()?, part()?);
            let whole = Runs {
                points: &standardised(&standards, &points),
                regressors: &regressors.values(&points),
                scores: &scores,
            };
            let restore = |(f, (choice, restored)): (usize, (Choice, Restored))| {
                let alpha = alpha.select_rows(&choice.components);
                let precisions = precisions.row(f).to_vec();
                Field::restored(kernel, choice, whole, Conditioned { restored, alpha, precisions })
            };
            let same = choices.len() == found.len();
            let parts: Vec<_> = choices.into_iter().zip(found).enumerate().collect();
            same.then(|| parts.into_par_iter().map(restore).collect()).flatten()
        };
        let fields: Vec<Field> = fields.ok_or_else(damaged)?;
        Ok(Self {
            plugin,
            kernel,
            names,
            standards,
            regressors,
            fields,
            points,
            scores,
            loadings,
            truncation,
            fit_error,
        })
    }
}

impl Forward for Kriging {
    fn dimension(&self) -> usize {
        self.standards.len()
    }

    fn outputs(&self) -> usize {
        self.loadings.columns()
    }

    fn mean(&self, points: &Matrix) -> Matrix {
        multiply(&self.basis(points), &self.loadings)
    }

    fn variance(&self, points: &Matrix) -> Option<Matrix> {
        let mut scores = Matrix::zeros(points.rows(), self.scores.columns());
        self.in_blocks(points, |first, standard, regressors| {
            for field in &self.fields {
                let variance = field.variance(standard, regressors);
                for (i, row) in variance.iter_rows().enumerate() {
                    for (&c, v) in field.choice.components.iter().zip(row) {
                        scores[(first + i, c)] = *v;
                    }
                }
            }
        });
        let squares = Matrix::from_fn(self.scores.columns(), self.outputs(), |c, j| {
            self.loadings[(c + 1, j)].powi(2)
        });
        let mut variance = multiply(&scores, &squares);
        for i in 0..points.rows() {
            variance.row_mut(i).iter_mut().zip(&self.truncation).for_each(|(v, t)| *v += t);
        }
        Some(variance)
    }

    fn jacobian(&self, point: &[f64]) -> Matrix {
        transposed_multiply(&self.loadings, &self.basis_gradient(point))
    }

    fn linear(&self) -> Option<&dyn Linear> {
        Some(self)
    }
}

impl Processes for Kriging {
    fn directions(&self) -> Matrix {
        self.loadings.select_rows(&(1..self.loadings.rows()).collect::<Vec<_>>())
    }

    fn covariances(&self, points: &Matrix) -> Vec<Matrix> {
        let standard = standardised(&self.standards, points);
        let regressors = self.regressors.values(points);
        let mut all = vec![Matrix::default(); self.scores.columns()];
        for field in &self.fields {
            let shared = field.shared_covariance(&standard, &regressors);
            for (&c, variance) in field.choice.components.iter().zip(field.variances()) {
                all[c] =
                    Matrix::from_fn(shared.rows(), shared.rows(), |i, j| variance * shared[(i, j)]);
            }
        }
        all
    }

    fn noise(&self) -> Vec<f64> {
        let mut all = vec![0.0; self.scores.columns()];
        for field in &self.fields {
            for (&c, variance) in field.choice.components.iter().zip(field.variances()) {
                all[c] = field.nugget * variance;
            }
        }
        all
    }
}

impl Emulator for Kriging {
    fn processes(&self) -> Option<&dyn Processes> {
        Some(self)
    }

    fn fit_error(&self) -> &FitError {
        &self.fit_error
    }

    fn facts(&self) -> Vec<Fact> {
        let neighbours = self.fields.first().and_then(|field| field.choice.neighbours);
        let all = |value: &dyn Fn(&Field) -> f64| spread(self.fields.iter().map(value).collect());
        let mut facts = vec![
            Fact::new("kernel", self.kernel.name()),
            Fact::new("components", self.scores.columns()),
            Fact::new(
                "terms of the trend (least, median, largest)",
                all(&|f| f.choice.terms.len() as f64),
            ),
        ];
        facts.extend(neighbours.map(|count| Fact::new("neighbours of a run", count)));
        for (k, name) in self.names.iter().enumerate() {
            let what =
                format!("length scale of `{name}` (least, median, largest; 1 is the design)");
            facts.push(Fact::new(what, all(&|f| f.choice.length_scales[k])));
        }
        facts.push(Fact::new("nugget (least, median, largest)", all(&|f| f.nugget)));
        let total: f64 = self.fields.iter().map(|f| f.log_likelihood).sum();
        facts.push(Fact::new("log marginal likelihood of the scores", format!("{total:.2}")));
        facts
    }

    fn save(&self) -> Result<Vec<u8>, Stop> {
        let found: Vec<Conditioned> = self.fields.iter().filter_map(Field::found).collect();
        let header = Header {
            kernel: self.kernel,
            names: self.names.clone(),
            standards: self.standards.clone(),
            regressors: self.regressors.written(),
            choices: self.fields.iter().map(|f| f.choice.clone()).collect(),
            found: found.iter().map(|found| found.restored.clone()).collect(),
            runs: self.points.rows(),
            components: self.scores.columns(),
            outputs: self.outputs(),
        };
        let mut alpha = Matrix::zeros(self.scores.columns(), self.points.rows());
        for (field, found) in self.fields.iter().zip(&found) {
            for (&c, row) in field.choice.components.iter().zip(found.alpha.iter_rows()) {
                alpha.row_mut(c).copy_from_slice(row);
            }
        }
        let mut numbers = vec![
            self.points.as_slice(),
            self.scores.as_slice(),
            self.loadings.as_slice(),
            &self.truncation,
            &self.fit_error.relative,
            self.fit_error.residuals.as_slice(),
        ];
        if !found.is_empty() {
            numbers.push(alpha.as_slice());
            numbers.extend(found.iter().map(|found| &found.precisions[..]));
        }
        bytes::write_as(self.plugin, &header, &numbers)
    }

    fn tables(&self) -> Result<Tables, String> {
        self.numbers()
    }
}

/// The constant and the scores are the basis functions: few, whatever the number of outputs and runs.
impl Linear for Kriging {
    fn coefficients(&self) -> &Matrix {
        &self.loadings
    }

    fn basis(&self, points: &Matrix) -> Matrix {
        let mut basis = Matrix::zeros(points.rows(), self.scores.columns() + 1);
        self.in_blocks(points, |first, standard, regressors| {
            for i in 0..standard.columns() {
                basis[(first + i, 0)] = 1.0;
            }
            for field in &self.fields {
                let mean = field.mean(standard, regressors);
                for (i, row) in mean.iter_rows().enumerate() {
                    for (&c, t) in field.choice.components.iter().zip(row) {
                        basis[(first + i, c + 1)] = *t;
                    }
                }
            }
        });
        basis
    }

    fn basis_gradient(&self, point: &[f64]) -> Matrix {
        let trend = self.regressors.gradient(point);
        let (standards, d) = (&self.standards, point.len());
        let place: Vec<f64> = (0..d).map(|k| standards[k].at(point[k])).collect();
        let slopes: Vec<f64> = (0..d).map(|k| standards[k].slope(point[k])).collect();
        let mut gradient = Matrix::zeros(self.scores.columns() + 1, d);
        for field in &self.fields {
            let (process, beta) = field.gradient(&place);
            let along = multiply(beta, &trend.select_rows(&field.choice.terms));
            for (row, &c) in field.choice.components.iter().enumerate() {
                for k in 0..d {
                    gradient[(c + 1, k)] = process[(row, k)] * slopes[k] + along[(row, k)];
                }
            }
        }
        gradient
    }
}

/// Formats the least, the median and the largest of some numbers with three digits.
fn spread(mut numbers: Vec<f64>) -> String {
    numbers.sort_by(f64::total_cmp);
    let text = |x: f64| {
        let plain = x == 0.0 || (1e-2..1e4).contains(&x);
        if plain { format!("{}", (x * 1e3).round() / 1e3) } else { format!("{x:.2e}") }
    };
    match numbers[..] {
        [] => "none".to_owned(),
        [least, .., largest] => {
            let median = numbers[numbers.len() / 2];
            format!("{}, {}, {}", text(least), text(median), text(largest))
        }
        [one] => text(one),
    }
}
