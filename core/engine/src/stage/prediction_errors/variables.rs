//! Errors of emulator and numerics as functions of independent standard normal variables.
//!
//! An error is `mean + F L u` with its factor `F`, a root `L` of the covariance of its weights given the data, and standard
//! normal `u`. The variables are turned into the principal components of the errors, each output counting with its own
//! standard deviation, and the last components are left out.

use std::ops::Range;

use lacuna::plugin::discrepancy::{CommonError, ErrorOrigin, ErrorPath};
use lacuna_linalg::vector::{add_scaled, dot};
use lacuna_linalg::{Error, Matrix, multiply, multiply_vector, symmetric_eigen};

use super::{Errors, hyper};

/// Share of the variance of the errors that the variables have.
const SHARE: f64 = 0.999;

/// Errors of emulator and numerics as functions of independent standard normal variables.
pub struct ErrorVariables<'a> {
    errors: &'a Errors,
    /// Factor of each error, `outputs x variables`.
    factors: Vec<(ErrorOrigin, Matrix)>,
    count: usize,
}

impl<'a> ErrorVariables<'a> {
    /// The errors whose origin is included, at these outputs.
    ///
    /// # Errors
    /// If a factor is not finite.
    pub fn of(
        errors: &'a Errors,
        included: impl Fn(&str) -> bool,
        outputs: &[usize],
    ) -> Result<Self, Error> {
        let mut factors = match errors {
            Errors::Prior(common) | Errors::Sampled { common, .. } => side_by_side(common),
            Errors::Given(given) => {
                let spread = |(origin, columns): &(ErrorOrigin, Range<usize>)| {
                    (origin.clone(), given.weights.spread(columns.clone()))
                };
                given.predictive.iter().map(spread).collect()
            }
        };
        factors.retain(|(origin, _)| included(origin.as_str()));
        let axes = principal(&factors, outputs)?;
        let count = axes.columns();
        for (_, factor) in &mut factors {
            *factor = multiply(factor, &axes);
        }
        Ok(Self { errors, factors, count })
    }

    /// Number of variables.
    pub fn count(&self) -> usize {
        self.count
    }

    /// The errors of a response at a point, for values of the variables.
    pub fn paths(&self, response: &[f64], point: &[f64], variables: &[f64]) -> Vec<ErrorPath> {
        let mean = self.mean(response, point);
        let path = |(k, (origin, factor)): (usize, &(ErrorOrigin, Matrix))| {
            let mut values = multiply_vector(factor, variables);
            if let Some(mean) = mean.get(k) {
                add_scaled(&mut values, 1.0, mean);
            }
            ErrorPath { origin: origin.clone(), values }
        };
        self.factors.iter().enumerate().map(path).collect()
    }

    /// Mean of each error given the data; empty if the data say nothing of it.
    fn mean(&self, response: &[f64], point: &[f64]) -> Vec<Vec<f64>> {
        let Errors::Given(given) = self.errors else { return Vec::new() };
        let whole = given.whole.likelihood();
        let (gradient, _) = whole.gradient(response, hyper(whole, point));
        let Some(weights) = given.weights.mean(&gradient) else { return Vec::new() };
        let kept = given.predictive.iter().filter(|(origin, _)| self.has(origin));
        kept.map(|(_, columns)| given.weights.values(&weights, columns.clone())).collect()
    }

    fn has(&self, origin: &ErrorOrigin) -> bool {
        self.factors.iter().any(|(own, _)| own == origin)
    }
}

/// Factors of independent errors, each with columns for the variables of all.
fn side_by_side(common: &[CommonError]) -> Vec<(ErrorOrigin, Matrix)> {
    let all: usize = common.iter().map(|error| error.factor.columns()).sum();
    let mut first = 0;
    let wide = |error: &CommonError| {
        let own = first..first + error.factor.columns();
        first = own.end;
        let value = |i: usize, k: usize| {
            if own.contains(&k) { error.factor[(i, k - own.start)] } else { 0.0 }
        };
        (error.origin.clone(), Matrix::from_fn(error.factor.rows(), all, value))
    };
    common.iter().map(wide).collect()
}

/// Directions of the variables that have most of the variance of the errors at these outputs, one per column.
fn principal(factors: &[(ErrorOrigin, Matrix)], outputs: &[usize]) -> Result<Matrix, Error> {
    let columns = factors.first().map_or(0, |(_, factor)| factor.columns());
    let mut gram = Matrix::zeros(columns, columns);
    let rows = factors.iter().flat_map(|(_, factor)| outputs.iter().map(|&i| factor.row(i)));
    for row in rows {
        let variance = dot(row, row);
        if variance > 0.0 {
            for (j, x) in row.iter().enumerate() {
                add_scaled(gram.row_mut(j), x / variance, row);
            }
        }
    }
    if columns == 0 {
        return Ok(gram);
    }
    let eigen = symmetric_eigen(&gram)?;
    let total: f64 = eigen.values.iter().sum();
    let mut left = total;
    let mut kept: Vec<usize> = Vec::new();
    for k in (0..columns).rev() {
        if left <= (1.0 - SHARE) * total {
            break;
        }
        left -= eigen.values[k];
        kept.push(k);
    }
    Ok(eigen.vectors.select_columns(&kept))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn error(origin: ErrorOrigin, rows: [[f64; 2]; 3]) -> CommonError {
        CommonError { origin, factor: Matrix::from_rows(2, rows).into(), predictive: true }
    }

    /// The covariance of all errors together is that of their factors, because independent errors stay independent.
    #[test]
    fn the_covariance_is_kept() {
        let errors = Errors::Prior(vec![
            error(ErrorOrigin::Emulator, [[1.0, 0.0], [0.5, 0.5], [0.0, 2.0]]),
            error(ErrorOrigin::Numerics, [[0.1, 0.1], [0.2, 0.2], [0.3, 0.3]]),
        ]);
        let all = ErrorVariables::of(&errors, |_| true, &[0, 1, 2]).unwrap();
        // The second error has one direction.
        assert_eq!(all.count(), 3);
        let unit = |k: usize| -> Vec<f64> { (0..3).map(|j| f64::from(u8::from(j == k))).collect() };
        let columns: Vec<Vec<ErrorPath>> = (0..3).map(|k| all.paths(&[], &[], &unit(k))).collect();
        let covariance = |(a, i): (usize, usize), (b, j): (usize, usize)| -> f64 {
            columns.iter().map(|paths| paths[a].values[i] * paths[b].values[j]).sum()
        };
        for (pair, expected) in [
            (((0, 0), (0, 0)), 1.0),
            (((0, 1), (0, 2)), 1.0),
            (((0, 0), (0, 2)), 0.0),
            (((1, 0), (1, 2)), 0.06),
            (((0, 1), (1, 1)), 0.0),
        ] {
            assert!((covariance(pair.0, pair.1) - expected).abs() < 1e-12, "{pair:?}");
        }
        let one = ErrorVariables::of(&errors, |origin| origin == "numerics", &[2]).unwrap();
        assert_eq!(one.count(), 1);
        assert!(
            (one.paths(&[], &[], &[2.0])[0].values[2].abs() - 2.0 * 0.18_f64.sqrt()).abs() < 1e-12
        );
    }

    #[test]
    fn no_errors_have_no_variables() {
        let none = Errors::none();
        let variables = ErrorVariables::of(&none, |_| true, &[0]).unwrap();
        assert_eq!(variables.count(), 0);
        assert!(variables.paths(&[1.0], &[], &[]).is_empty());
    }
}
