//! `emulator`: the fitted surrogate.

use lacuna::plugin::Emulator;
use lacuna::plugin::model::EvalError;
use lacuna::run::Stop;
use lacuna_linalg::Matrix;
use lacuna_linalg::vector::dot;

use super::{Derivatives, Function, Part, Variable, parameters, parts};
use crate::stage::emulator_error;
use crate::stage::inverse_problem::InverseProblem;
use crate::study::Study;

/// Mean of the emulator as a function of the study's parameters.
pub(super) struct Emulated<'a> {
    study: &'a Study,
    emulator: &'a dyn Emulator,
    /// Interval of each parameter in which it was fitted.
    region: Vec<(f64, f64)>,
    parts: Vec<Part>,
    /// Standard deviation of the error of each output over the prior.
    deviations: Vec<f64>,
}

impl<'a> Emulated<'a> {
    /// The emulator of a finished run, if it has one.
    pub(super) fn of(study: &'a Study, problem: &InverseProblem<'a>) -> Result<Option<Self>, Stop> {
        let (Some(emulator), Some(fitted)) = (problem.emulator(), problem.fitted()) else {
            return Ok(None);
        };
        let whole = || study.parameters.iter().map(|p| p.design.support()).collect();
        let region = problem.region().map_or_else(whole, <[_]>::to_vec);
        let error = emulator_error::over_prior(study, &fitted.value)?;
        let deviations = error.factor.iter_rows().map(|row| dot(row, row).sqrt()).collect();
        Ok(Some(Self { study, emulator, region, parts: parts(study), deviations }))
    }

    /// Interval of each parameter in which it was fitted.
    pub(super) fn region(&self) -> &[(f64, f64)] {
        &self.region
    }

    /// Standard deviation of the error of each output over the prior.
    pub(super) fn over_prior(&self) -> &[f64] {
        &self.deviations
    }

    /// Rejects points outside the region of the fit, where the emulator is not valid.
    fn inside(&self, point: &[f64]) -> Result<(), EvalError> {
        for ((x, (low, high)), p) in point.iter().zip(&self.region).zip(&self.study.parameters) {
            if !(low..=high).contains(&x) {
                return Err(EvalError::Rejected(format!(
                    "`{}` is {x}, outside {low} to {high} where the emulator was fitted",
                    p.name
                )));
            }
        }
        Ok(())
    }
}

impl Function for Emulated<'_> {
    fn name(&self) -> &'static str {
        "emulator"
    }

    fn variables(&self) -> Vec<Variable> {
        parameters(self.study)
    }

    fn outputs(&self) -> usize {
        self.emulator.outputs()
    }

    fn scenarios(&self) -> &[Part] {
        &self.parts
    }

    fn values(&self, point: &[f64], scenario: Option<usize>) -> Result<Vec<f64>, EvalError> {
        self.inside(point)?;
        let row = Matrix::from_vec(1, point.len(), point.to_vec());
        let all = self.emulator.mean(&row).into_vec();
        Ok(match scenario {
            Some(i) => all[self.parts[i].outputs.clone()].to_vec(),
            None => all,
        })
    }

    fn batch(&self, points: &Matrix) -> Result<Matrix, EvalError> {
        let mut all = self.emulator.mean(points);
        for (i, point) in points.iter_rows().enumerate() {
            if self.inside(point).is_err() {
                all.row_mut(i).fill(f64::NAN);
            }
        }
        Ok(all)
    }

    /// The variance that the emulator states at each point, otherwise that of its error curves over the prior.
    fn deviations(&self, points: &Matrix) -> Option<Matrix> {
        let outputs = self.emulator.outputs();
        Some(match self.emulator.variance(points) {
            Some(variance) => {
                Matrix::from_fn(points.rows(), outputs, |i, j| variance[(i, j)].sqrt())
            }
            None => Matrix::from_fn(points.rows(), outputs, |_, j| self.deviations[j]),
        })
    }

    fn derivatives(&self) -> Option<&dyn Derivatives> {
        Some(self)
    }
}

impl Derivatives for Emulated<'_> {
    fn jacobian(&self, point: &[f64], scenario: Option<usize>) -> Result<Matrix, EvalError> {
        self.inside(point)?;
        let all = self.emulator.jacobian(point);
        Ok(match scenario {
            Some(i) => all.select_rows(&self.parts[i].outputs.clone().collect::<Vec<_>>()),
            None => all,
        })
    }

    fn scales(&self) -> Option<Vec<f64>> {
        let widths = self.study.parameters.iter().map(|p| {
            let [low, high] = [0.05, 0.95].map(|share| p.design.quantile(share));
            high - low
        });
        Some(widths.collect())
    }
}
