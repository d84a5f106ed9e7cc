//! Common errors checked against errors that were left out, and completed by what these show to be missing.
//!
//! A covariance from `m` error curves of many outputs is of rank `m` at most: it takes a new error's part outside their
//! span for zero. A likelihood that knows the rest of the data as well as the noise of a mean curve then
//! reads that part as a change of the parameters, and is sure of it. How much this matters is measured: each
//! error is left out, the covariance made from the others, and the shift found that the error causes in the
//! best fit of the model linearised in its parameters (generalised least squares),
//!
//! ```text
//! shift = (J'A J + I)^-1 J'A e        A = (V + sum F F')^-1
//! ```
//!
//! with the slopes `J` per standard deviation of the prior, the noise `V` of the mean curve and the common errors `F`. The mean
//! square of the shifts beyond what the covariance says of them, its positive part `M`, is added as the common error
//! `J M J'`: it leaves the fit where it is and gives the parameters the uncertainty that errors left out have shown, at the
//! cost of a column a parameter.
//!
//! The mean square is multiplied by `m / (m - d - 1)` for `d` parameters, which makes the inverse of a covariance from
//! `m` samples unbiased (Hartlap, Simon and Schneider, Astronomy and Astrophysics 464 (2007) 399; Sellentin
//! and Heavens, MNRAS 456 (2016) L132).

use crate::data::Measurements;
use crate::linalg::{self, Cholesky, Matrix};
use crate::plugin::discrepancy::CommonError;
use crate::run::Stop;

/// Parts into which the errors of one origin are divided, to be left out in turn; fewer errors one by one.
const PARTS: usize = 20;
/// How many errors of one origin are used at most.
const MOST: usize = 1000;

/// A common error with the errors it was estimated from.
#[derive(Debug, Clone)]
pub struct Sampled {
    /// The covariance.
    pub error: CommonError,
    /// Errors, `samples x outputs`, of which the covariance is the mean square.
    pub samples: Matrix,
    /// Whether the samples hold the noise of the mean curve too.
    pub noisy: bool,
}

/// The response at the best fit and its derivatives, to which the errors are compared.
#[derive(Debug, Clone)]
pub struct Fit {
    /// The response.
    pub response: Vec<f64>,
    /// Its derivative by each parameter, per standard deviation of the prior, `outputs x parameters`.
    pub slopes: Matrix,
}

/// The common errors, completed; see the module.
pub fn completed(
    sources: Vec<Sampled>,
    data: &Measurements,
    fit: &Fit,
) -> Result<Vec<CommonError>, Stop> {
    let Some(weight) = weights(data, &fit.response) else {
        return Ok(sources.into_iter().map(|s| s.error).collect());
    };
    let sources: Vec<Sampled> = sources.into_iter().map(thinned).collect();
    let products = Products::of(&sources, &weight, &fit.slopes);
    let mut errors = Vec::with_capacity(sources.len());
    for (s, source) in sources.into_iter().enumerate() {
        let missing = products.missing(s, source.noisy)?;
        let more = linalg::multiply(&fit.slopes, &missing);
        errors.push(CommonError { factor: beside(&source.error.factor, &more), ..source.error });
    }
    Ok(errors)
}

/// One over the variance of each output's mean: between the replicates, pooled over the curve; of the residuals where
/// there are no replicates. `None` where neither is above zero.
pub(super) fn weights(data: &Measurements, response: &[f64]) -> Option<Vec<f64>> {
    let summaries = data.summaries();
    let pooled = |indices: &[usize]| {
        let of = indices.iter().map(|&i| &summaries[i]).filter(|s| s.count > 1);
        let (scatter, freedom) =
            of.fold((0.0, 0.0), |(a, b), s| (a + s.scatter, b + s.count as f64 - 1.0));
        (scatter > 0.0).then(|| scatter / freedom)
    };
    let residual = || {
        let measured = summaries.iter().zip(response).filter(|(s, _)| s.count > 0);
        let squares = measured.map(|(s, y)| (s.mean - y).powi(2)).sum::<f64>();
        let count = summaries.iter().filter(|s| s.count > 0).count() as f64;
        (squares > 0.0).then(|| squares / count)
    };
    let all: Vec<usize> = (0..summaries.len()).collect();
    let overall = pooled(&all).or_else(residual)?;
    let mut weight = vec![0.0; summaries.len()];
    for group in data.layout.groups() {
        let variance = pooled(&group.indices).unwrap_or(overall);
        group.indices.iter().for_each(|&i| weight[i] = summaries[i].count as f64 / variance);
    }
    Some(weight)
}

/// At most [`MOST`] samples, evenly.
fn thinned(source: Sampled) -> Sampled {
    let count = source.samples.rows();
    if count <= MOST {
        return source;
    }
    let kept: Vec<usize> = (0..MOST).map(|k| k * count / MOST).collect();
    Sampled { samples: source.samples.select_rows(&kept), ..source }
}

/// The products of slopes and errors in the metric of the noise: all that the shifts depend on.
struct Products {
    /// The number of parameters; their slopes are the first columns.
    parameters: usize,
    /// The columns of each source, errors over the root of their number.
    columns: Vec<std::ops::Range<usize>>,
    gram: Matrix,
}

impl Products {
    fn of(sources: &[Sampled], weight: &[f64], slopes: &Matrix) -> Self {
        let parameters = slopes.columns();
        let mut rows = slopes.transposed();
        let mut columns = Vec::new();
        for source in sources {
            let (from, count) = (rows.rows(), source.samples.rows());
            let scale = (count as f64).sqrt();
            for row in source.samples.iter_rows() {
                rows.push_row(&row.iter().map(|e| e / scale).collect::<Vec<_>>());
            }
            columns.push(from..from + count);
        }
        let root: Vec<f64> = weight.iter().map(|w| w.sqrt()).collect();
        let white = Matrix::from_fn(rows.columns(), rows.rows(), |i, k| root[i] * rows[(k, i)]);
        Self { parameters, columns, gram: linalg::gram(&white) }
    }

    fn block(&self, rows: &[usize], columns: &[usize]) -> Matrix {
        Matrix::from_fn(rows.len(), columns.len(), |i, k| self.gram[(rows[i], columns[k])])
    }

    /// A factor of what the covariance of a source misses, in units of the parameters.
    fn missing(&self, source: usize, noisy: bool) -> Result<Matrix, Stop> {
        let own = self.columns[source].clone();
        let (d, count) = (self.parameters, own.len());
        if count < 2 {
            return Ok(Matrix::zeros(d, 0));
        }
        let parts = count.min(if count <= 2 * PARTS { count } else { PARTS });
        let finite = count as f64 / (count as f64 - d as f64 - 1.0).max(1.0);
        let mut excess = Matrix::zeros(d, d);
        let mut information = Matrix::zeros(d, d);
        for part in 0..parts {
            let left: Vec<usize> =
                own.clone().filter(|k| (k - own.start) % parts == part).collect();
            let shifts = self.shifts(&own, &left, noisy)?;
            // The columns are errors over the root of their number, so that the sum is the mean square.
            let share = left.len() as f64 / count as f64;
            for i in 0..d {
                for j in 0..d {
                    excess[(i, j)] += finite * shifts.made[(i, j)] - share * shifts.stated[(i, j)];
                    information[(i, j)] += share * shifts.information[(i, j)];
                }
            }
        }
        positive_part(&excess, &information)
    }

    fn shifts(
        &self,
        own: &std::ops::Range<usize>,
        left: &[usize],
        noisy: bool,
    ) -> Result<Shifts, Stop> {
        let d = self.parameters;
        let slopes: Vec<usize> = (0..d).collect();
        let kept: Vec<usize> =
            (d..self.gram.rows()).filter(|k| left.binary_search(k).is_err()).collect();
        let more = (own.len() as f64 / (own.len() - left.len()) as f64).sqrt();
        let scale: Vec<f64> =
            kept.iter().map(|k| if own.contains(k) { more } else { 1.0 }).collect();
        let capacitance = Matrix::from_fn(kept.len(), kept.len(), |i, k| {
            f64::from(u8::from(i == k)) + scale[i] * scale[k] * self.gram[(kept[i], kept[k])]
        });
        let capacitance = Cholesky::new(&capacitance).map_err(failed)?;
        // `F'V^-1 J`, and with it `F'A J`.
        let reach =
            Matrix::from_fn(kept.len(), d, |i, j| scale[i] * self.gram[(kept[i], slopes[j])]);
        let pulled = capacitance.solve_matrix(&reach);
        let minus = |a: &Matrix, b: &Matrix| {
            Matrix::from_fn(a.rows(), a.columns(), |i, j| a[(i, j)] - b[(i, j)])
        };
        let fisher =
            minus(&self.block(&slopes, &slopes), &linalg::transposed_multiply(&reach, &pulled));
        let errors = Matrix::from_fn(kept.len(), left.len(), |i, k| {
            scale[i] * self.gram[(kept[i], left[k])]
        });
        let pulls =
            minus(&self.block(&slopes, left), &linalg::transposed_multiply(&pulled, &errors));
        let mut information = fisher.clone();
        (0..d).for_each(|j| information[(j, j)] += 1.0);
        let solver = Cholesky::new(&information).map_err(failed)?;
        let of_own: Vec<usize> = (0..kept.len()).filter(|&i| own.contains(&kept[i])).collect();
        let mut stated = linalg::gram(&pulled.select_rows(&of_own));
        if noisy {
            let noise = minus(&fisher, &linalg::gram(&pulled));
            let entries = stated.as_mut_slice().iter_mut().zip(noise.as_slice());
            entries.for_each(|(s, n)| *s += n);
        }
        let shifts = solver.solve_matrix(&pulls);
        let half = solver.solve_matrix(&stated);
        Ok(Shifts {
            made: linalg::multiply_transposed(&shifts, &shifts),
            stated: solver.solve_matrix(&half.transposed()),
            information,
        })
    }
}

/// The squares of the shifts that errors make, and what the covariance says of them.
struct Shifts {
    made: Matrix,
    stated: Matrix,
    /// `J'A J + I`.
    information: Matrix,
}

/// A factor of the part of a symmetric matrix that is positive, relative to the inverse of another.
fn positive_part(excess: &Matrix, information: &Matrix) -> Result<Matrix, Stop> {
    let root = Cholesky::new(information).map_err(failed)?;
    let lower = root.lower();
    let white = linalg::multiply(&linalg::transposed_multiply(lower, excess), lower);
    let eigen = linalg::symmetric_eigen(&white).map_err(failed)?;
    let positive: Vec<usize> = (0..eigen.values.len()).filter(|&k| eigen.values[k] > 0.0).collect();
    let directions = eigen.vectors.select_columns(&positive);
    let turned = linalg::transposed_multiply(&root.lower_inverse(), &directions);
    Ok(Matrix::from_fn(turned.rows(), turned.columns(), |i, k| {
        turned[(i, k)] * eigen.values[positive[k]].sqrt()
    }))
}

fn beside(a: &Matrix, b: &Matrix) -> Matrix {
    let split = a.columns();
    Matrix::from_fn(a.rows(), split + b.columns(), |i, k| {
        if k < split { a[(i, k)] } else { b[(i, k - split)] }
    })
}

fn failed(e: impl std::fmt::Display) -> Stop {
    Stop::new(format!("the errors left out of the common errors' covariance: {e}"))
}

#[cfg(test)]
mod tests;
