//! Processes as numbers for other programs.

use lacuna::plugin::surrogate::Tables;
use lacuna_linalg::Matrix;

use super::emulator::Kriging;
use super::regressors::Regressors;
use crate::surrogates::polynomial_chaos::add_basis;

impl Kriging {
    /// Trend, weights of the runs and loadings: `y = offset + (psi(x) coefficient + k(x) weight) loading`.
    pub(super) fn numbers(&self) -> Result<Tables, String> {
        let mut all = Tables::default();
        self.add_regressors(&mut all)?;
        let (components, runs) = (self.scores.columns(), self.points.rows());
        let mut coefficient = Matrix::zeros(self.regressors.count(), components);
        let mut weight = Matrix::zeros(runs, components);
        let mut length_scale = Matrix::zeros(components, self.standards.len());
        for field in &self.fields {
            let (alpha, beta) = field.weights();
            for (row, &c) in field.choice.components.iter().enumerate() {
                for (&term, b) in field.choice.terms.iter().zip(beta.row(row)) {
                    coefficient[(term, c)] = *b;
                }
                for (run, a) in alpha.row(row).iter().enumerate() {
                    weight[(run, c)] = *a;
                }
                length_scale.row_mut(c).copy_from_slice(&field.choice.length_scales);
            }
        }
        all.matrix("coefficient", "term", "component", &coefficient);
        all.texts.push(("kernel".to_owned(), self.kernel.name().to_owned()));
        for (k, name) in ["run_log", "run_centre", "run_scale"].iter().enumerate() {
            let column = self.standards.iter().map(|standard| standard.closed()[k]);
            all.column(name, "parameter", column.collect());
        }
        let place = |i: usize, k: usize| self.standards[k].at(self.points[(i, k)]);
        all.matrix("run", "run", "parameter", &Matrix::from_fn(runs, self.standards.len(), place));
        all.matrix("length_scale", "component", "parameter", &length_scale);
        all.matrix("weight", "run", "component", &weight);
        all.column("offset", "output", self.loadings.row(0).to_vec());
        let loading = self.loadings.select_rows(&(1..=components).collect::<Vec<_>>());
        all.matrix("loading", "component", "output", &loading);
        Ok(all)
    }

    /// The regressors as products of polynomials in standard variables.
    fn add_regressors(&self, all: &mut Tables) -> Result<(), String> {
        if let Regressors::Polynomials(basis) = &self.regressors {
            return add_basis(basis, all);
        }
        // The standard variable itself is the polynomial of degree one.
        let d = self.standards.len();
        for (k, name) in ["log", "centre", "scale"].iter().enumerate() {
            all.column(name, "parameter", self.standards.iter().map(|s| s.closed()[k]).collect());
        }
        all.column("bound", "parameter", vec![f64::INFINITY; d]);
        all.matrix("recurrence_centre", "parameter", "degree", &Matrix::zeros(d, 1));
        all.matrix("recurrence_size", "parameter", "degree", &Matrix::from_fn(d, 1, |_, _| 1.0));
        let exponent = |term: usize, k: usize| if term == k + 1 { 1.0 } else { 0.0 };
        let exponent = Matrix::from_fn(self.regressors.count(), d, exponent);
        all.matrix("exponent", "term", "parameter", &exponent);
        Ok(())
    }
}
