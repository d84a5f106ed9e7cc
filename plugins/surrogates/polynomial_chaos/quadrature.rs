//! Projection with the weights of a quadrature rule whose nodes are the runs.

use lacuna::data::Parameter;
use lacuna::run::Stop;
use lacuna_linalg::{Matrix, multiply_vector, thin_qr, transposed_multiply_vector};

use super::coordinate::Coordinate;
use super::family::Family;
use super::judge::correction;
use super::least_squares::Fit;
use super::output::Output;
use super::recurrence::Recurrence;
use crate::designs::quadrature::{Nodes, Rule};

/// Largest distance of a run from its node in standard variables, relative to `1 + |z|`: nodes return from
/// probabilities and physical units with rounding errors, which are largest far out.
const NEAR: f64 = 1e-6;

/// Quadrature rule formed by the runs.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Projection {
    /// Type of the rule.
    pub rule: Rule,
    /// Level of the rule, which is the highest degree it determines.
    pub level: usize,
    /// Weight of each run.
    pub weights: Vec<f64>,
}

impl Projection {
    /// Finds the rule whose nodes these points are (one per row, in physical units); fails if there is none.
    pub fn of(family: Family, parameters: &[Parameter], points: &Matrix) -> Result<Self, Stop> {
        let runs = points.rows();
        let mut nearest = 0;
        for rule in [Rule::Tensor, Rule::Smolyak] {
            for level in 0..runs {
                let coordinates: Result<Vec<Coordinate>, String> =
                    parameters.iter().map(|p| Coordinate::new(family, p, level + 1)).collect();
                let Ok(coordinates) = coordinates else { break };
                let axes: Vec<Recurrence> =
                    coordinates.iter().map(|c| c.recurrence(level + 1)).collect();
                let Some(nodes) = rule.nodes(&axes, level, runs) else { break };
                let (weights, found) = matched(&nodes, &coordinates, points);
                nearest = nearest.max(found);
                if let Some(weights) = weights {
                    return Ok(Self { rule, level, weights });
                }
            }
        }
        let others = runs - nearest;
        Err(Stop::new(format!(
            "`surrogate.solver`: the {runs} training runs are not the nodes of a quadrature rule: {others} of \
             them are not nodes of the most similar rule"
        ))
        .help(
            "make the runs with `[design] use = \"quadrature\"` and the same `basis`, and give `training` the \
             number of its nodes",
        ))
    }

    /// Returns the projection on basis functions at the runs (`runs x terms`).
    pub fn on<'a>(&'a self, basis: &'a Matrix) -> Projected<'a> {
        let squares = |row: &[f64]| row.iter().map(|x| x * x).sum::<f64>();
        // With positive weights the projection is the weighted least-squares fit, and this is its hat matrix;
        // otherwise the leverage of the unweighted fit tells how strongly a run attracts the expansion.
        let weighted = basis.iter_rows().zip(&self.weights).map(|(row, w)| w * squares(row));
        let leverage = if self.weights.iter().all(|w| *w > 0.0) {
            weighted.collect()
        } else {
            thin_qr(basis).map_or_else(
                |_| vec![1.0; basis.rows()],
                |qr| qr.q.iter_rows().map(squares).collect(),
            )
        };
        Projected { projection: self, basis, leverage }
    }
}

/// Projection on a fixed set of basis functions, for any number of outputs.
pub(super) struct Projected<'a> {
    projection: &'a Projection,
    basis: &'a Matrix,
    leverage: Vec<f64>,
}

impl Projected<'_> {
    /// Computes the coefficients `c_t = sum_i w_i y_i psi_t(x_i)` of one output; the first belongs to the constant.
    pub fn fit(&self, output: &Output) -> Fit {
        let (runs, terms) = (self.basis.rows(), self.basis.columns());
        let Output { mean, centred, variance } = output;
        let weighted: Vec<f64> =
            centred.iter().zip(&self.projection.weights).map(|(y, w)| y * w).collect();
        let mut coefficients = transposed_multiply_vector(self.basis, &weighted);
        let model = multiply_vector(self.basis, &coefficients);
        coefficients[0] += mean;
        let residuals: Vec<f64> = (centred.iter().zip(&model).zip(&self.leverage))
            .map(|((y, m), h)| (y - m) / (1.0 - h).max(f64::EPSILON))
            .collect();
        let squares = residuals.iter().map(|r| r * r).sum::<f64>() / runs as f64;
        // Under the rule's weights the Gram matrix is the identity.
        let trace = terms as f64 / runs as f64;
        let relative = squares / variance * correction(runs, terms, trace);
        let relative = if relative.is_nan() { f64::INFINITY } else { relative };
        Fit { coefficients, relative, residuals }
    }
}

/// Returns the weight of each run if runs and nodes match one to one, and the number of runs that are nodes.
fn matched(
    nodes: &Nodes,
    coordinates: &[Coordinate],
    points: &Matrix,
) -> (Option<Vec<f64>>, usize) {
    let mut taken = vec![false; nodes.weights.len()];
    let mut weights = Vec::with_capacity(points.rows());
    for point in points.iter_rows() {
        let z: Vec<f64> = point.iter().zip(coordinates).map(|(x, c)| c.standard(*x)).collect();
        let near = |k: &usize| {
            let mut pairs = nodes.points.row(*k).iter().zip(&z);
            !taken[*k] && pairs.all(|(a, b)| (a - b).abs() < NEAR * (1.0 + a.abs()))
        };
        if let Some(k) = (0..taken.len()).find(near) {
            taken[k] = true;
            weights.push(nodes.weights[k]);
        }
    }
    let found = weights.len();
    let whole = found == points.rows() && found == taken.len();
    (whole.then_some(weights), found)
}
