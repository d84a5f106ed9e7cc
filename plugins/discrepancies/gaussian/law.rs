//! Treatment of the groups' variances: given, integrated out, or given and coupled by common errors.

use std::sync::Arc;

use lacuna::math::distribution::Distribution;
use lacuna::plugin::discrepancy::CommonError;
use lacuna::run::Stop;
use lacuna_linalg::vector::dot;
use lacuna_linalg::{Cholesky, Matrix};

use super::grams::Grams;
use super::integral::{Integral, conjugate, integrate};
use super::statistics::{Directions, Residual, Spread, Statistics};
use crate::discrepancies::common::PerGroup;

/// Treatment of the groups' variances (see the module).
#[derive(Debug, Clone)]
pub(super) enum Law {
    /// Each group has its own variance, and at most one group has common errors.
    Given(PerGroup),
    /// The variance of each group is integrated out under this prior.
    Integrated(Distribution),
    /// Common errors reach several groups.
    Coupled(Coupled),
}

/// Common errors over several groups: with `W F = Q_g T_g` in group `g`, `Q_g` its orthonormal directions, the
/// minimum of `sum_g |a_g - T_g zeta|^2 / v_g + |zeta|^2` over `zeta` is the quadratic form, and
/// `C = I + sum_g T_g'T_g / v_g` gives the determinant (Woodbury).
#[derive(Debug, Clone)]
pub(super) struct Coupled {
    variance: PerGroup,
    /// `T_g` of each group.
    factors: Vec<Matrix>,
    grams: Grams,
}

/// Derivatives of the log-likelihood with respect to the residual of each group.
pub(super) struct Slopes {
    /// Divisor of the residual outside the directions, for each group.
    pub outside: Vec<f64>,
    /// Minus half the derivative with respect to each residual along a direction.
    pub along: Vec<Vec<f64>>,
    /// Derivatives with respect to the hyperparameters.
    pub by_hyper: Vec<f64>,
}

impl Law {
    /// Returns the log-likelihood; minus infinity if a variance is not above zero.
    pub fn log_likelihood(
        &self,
        spreads: &[&Spread],
        hyper: &[f64],
        residuals: &[Residual<'_>],
    ) -> f64 {
        let groups = spreads.iter().zip(residuals);
        match self {
            Self::Given(variance) => {
                let Some(v) = variance.values(hyper) else { return f64::NEG_INFINITY };
                groups.zip(v).map(|((s, r), &v)| s.log_likelihood(v, *r)).sum()
            }
            Self::Integrated(prior) => groups
                .map(|(s, r)| {
                    conjugate(s, r.outside, prior).unwrap_or_else(|| integrate(s, *r, prior).log)
                })
                .sum(),
            Self::Coupled(coupled) => coupled
                .solve(hyper, residuals)
                .map_or(f64::NEG_INFINITY, |solved| solved.log_likelihood(spreads)),
        }
    }

    /// Returns the derivatives; `None` if a variance is not above zero.
    pub fn slopes(
        &self,
        spreads: &[&Spread],
        hyper: &[f64],
        residuals: &[Residual<'_>],
    ) -> Option<Slopes> {
        let groups = spreads.iter().zip(residuals);
        let mut by_hyper = vec![0.0; hyper.len()];
        match self {
            Self::Given(variance) => {
                let v = variance.values(hyper)?;
                let by_v: Vec<f64> =
                    groups.clone().zip(v).map(|((s, r), &v)| s.by_variance(v, *r)).collect();
                variance.add_gradient(&by_v, &mut by_hyper);
                let along = |((s, r), &v): ((&&Spread, &Residual<'_>), &f64)| {
                    r.along.iter().zip(&s.eigenvalues).map(|(a, l)| a / (v + l)).collect()
                };
                Some(Slopes {
                    outside: v.to_vec(),
                    along: groups.zip(v).map(along).collect(),
                    by_hyper,
                })
            }
            Self::Integrated(prior) => {
                let mut slopes = Slopes { outside: Vec::new(), along: Vec::new(), by_hyper };
                for (spread, residual) in groups {
                    let Integral { nodes, .. } = integrate(spread, *residual, prior);
                    let average = |l: f64| nodes.iter().map(|(v, p)| p / (v + l)).sum::<f64>();
                    slopes.outside.push(1.0 / average(0.0));
                    let pairs = residual.along.iter().zip(&spread.eigenvalues);
                    slopes.along.push(pairs.map(|(a, &l)| a * average(l)).collect());
                }
                Some(slopes)
            }
            Self::Coupled(coupled) => {
                let solved = coupled.solve(hyper, residuals)?;
                let by_v = coupled.by_variance(&solved, spreads);
                coupled.variance.add_gradient(&by_v, &mut by_hyper);
                let along = |(rest, &v): (&Vec<f64>, &f64)| rest.iter().map(|a| a / v).collect();
                Some(Slopes {
                    outside: solved.variance.to_vec(),
                    along: solved.rest.iter().zip(solved.variance).map(along).collect(),
                    by_hyper,
                })
            }
        }
    }

    /// Returns true if the variances depend on the response.
    pub fn learns_variances(&self) -> bool {
        matches!(self, Self::Integrated(_))
    }

    /// Returns the variance of each group as pairs of values and probabilities; the residuals have no effect unless the
    /// variances are [learned](Self::learns_variances) from them.
    pub fn variances(
        &self,
        spreads: &[&Spread],
        hyper: &[f64],
        residuals: &[Residual<'_>],
    ) -> Option<Vec<Vec<(f64, f64)>>> {
        match self {
            Self::Integrated(prior) => {
                let groups = spreads.iter().zip(residuals);
                Some(groups.map(|(s, r)| integrate(s, *r, prior).nodes).collect())
            }
            Self::Given(variance) | Self::Coupled(Coupled { variance, .. }) => {
                Some(variance.values(hyper)?.iter().map(|&v| vec![(v, 1.0)]).collect())
            }
        }
    }
}

/// Maximum over the common errors at one set of variances.
struct Solved<'a> {
    variance: &'a [f64],
    zeta: Vec<f64>,
    capacitance: Cholesky,
    /// `a_g - T_g zeta` of each group.
    rest: Vec<Vec<f64>>,
    /// Squared residual of each group after subtracting the common errors.
    squares: Vec<f64>,
}

impl Solved<'_> {
    fn log_likelihood(&self, spreads: &[&Spread]) -> f64 {
        let mut twice = dot(&self.zeta, &self.zeta) + self.capacitance.log_determinant();
        for ((spread, &v), squares) in spreads.iter().zip(self.variance).zip(&self.squares) {
            twice += spread.count * (std::f64::consts::TAU * v).ln() + spread.log_scale;
            twice += (spread.scatter + squares) / v;
        }
        -0.5 * twice
    }
}

impl Coupled {
    /// Couples groups by common errors, and sets the directions of each group's statistics.
    pub fn new(
        groups: &mut [Statistics],
        common: &[CommonError],
        variance: PerGroup,
    ) -> Result<Self, Stop> {
        let failed = |e| Stop::new(format!("the covariance of the common errors: {e}"));
        let weighted: Vec<Matrix> = groups.iter().map(|g| g.weighted(common)).collect();
        let columns = weighted.first().map_or(0, Matrix::columns);
        let all = Matrix::from_rows(columns, weighted.iter().flat_map(Matrix::iter_rows));
        // The right singular vectors rotate the common errors to the smallest number of directions that span them.
        let svd = lacuna_linalg::thin_svd(&all).map_err(failed)?;
        let rank = svd.values.iter().filter(|&&s| s > 1e-12 * svd.values[0]).count();
        let turn = svd.v.select_columns(&(0..rank).collect::<Vec<_>>());
        let mut factors = Vec::new();
        for (group, weighted) in groups.iter_mut().zip(&weighted) {
            let qr = lacuna_linalg::thin_qr(&lacuna_linalg::multiply(weighted, &turn))
                .map_err(failed)?;
            group.common =
                Arc::new(Directions { rows: qr.q.transposed(), eigenvalues: Vec::new() });
            factors.push(qr.r);
        }
        Ok(Self { variance, grams: Grams::of(&factors), factors })
    }

    fn solve<'a>(&'a self, hyper: &'a [f64], residuals: &[Residual<'_>]) -> Option<Solved<'a>> {
        let variance = self.variance.values(hyper)?;
        let rank = self.factors.first().map_or(0, Matrix::columns);
        let mut capacitance = self.grams.sum(&self.factors, variance);
        let mut zeta = vec![0.0; rank];
        for (g, &v) in variance.iter().enumerate() {
            let pull =
                lacuna_linalg::transposed_multiply_vector(&self.factors[g], residuals[g].along);
            zeta.iter_mut().zip(pull).for_each(|(z, p)| *z += p / v);
        }
        for k in 0..rank {
            capacitance[(k, k)] += 1.0;
        }
        let capacitance = Cholesky::new(&capacitance).ok()?;
        capacitance.solve(&mut zeta);
        let rest = |(factor, residual): (&Matrix, &Residual<'_>)| -> Vec<f64> {
            let made = factor.iter_rows().map(|row| dot(row, &zeta));
            residual.along.iter().zip(made).map(|(a, m)| a - m).collect()
        };
        let rest: Vec<Vec<f64>> = self.factors.iter().zip(residuals).map(rest).collect();
        let squares = residuals.iter().zip(&rest).map(|(r, a)| r.outside + dot(a, a)).collect();
        Some(Solved { variance, zeta, capacitance, rest, squares })
    }

    /// Returns the derivatives with respect to the variances by Fisher's identity: those at fixed common errors,
    /// averaged over the errors given the data.
    fn by_variance(&self, solved: &Solved<'_>, spreads: &[&Spread]) -> Vec<f64> {
        let traces = self.grams.traces(&self.factors, &solved.capacitance);
        let one = |(g, spread): (usize, &&Spread)| {
            let v = solved.variance[g];
            let squares = spread.scatter + solved.squares[g] + traces[g];
            -0.5 * (spread.count / v - squares / (v * v))
        };
        spreads.iter().enumerate().map(one).collect()
    }
}
