//! Projection by the weights of a quadrature rule whose nodes are the runs.

use lacuna::data::Parameter;
use lacuna::linalg::{Matrix, multiply_vector, thin_qr, transposed_multiply_vector};
use lacuna::run::Stop;

use super::coordinate::Coordinate;
use super::family::Family;
use super::judge::correction;
use super::least_squares::Fit;
use super::recurrence::Recurrence;
use super::search::Output;
use crate::designs::quadrature::{Nodes, Rule};

/// How far a run may lie from its node, in standard variables: nodes come back from probabilities and physical
/// units with round-off, which is largest far out.
const NEAR: f64 = 1e-6;

/// The rule that the runs are.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Projection {
    /// Which rule.
    pub rule: Rule,
    /// Its level, the highest degree that it finds.
    pub level: usize,
    /// The weight of each run.
    pub weights: Vec<f64>,
}

impl Projection {
    /// The rule whose nodes these points are, one a row in physical units.
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
             them are no nodes of the rule that fits best"
        ))
        .help(
            "make the runs with `[design] use = \"quadrature\"` and the same `basis`, and give `training` the \
             number of its nodes",
        ))
    }

    /// The projection on basis functions at the runs, `runs x terms`.
    pub fn on<'a>(&'a self, basis: &'a Matrix) -> Projected<'a> {
        let squares = |row: &[f64]| row.iter().map(|x| x * x).sum::<f64>();
        // Where all weights are positive the projection is the weighted least-squares fit, and this its
        // hat matrix; otherwise that of the plain fit says how far a run can draw the expansion to itself.
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

/// A projection on a fixed set of basis functions, for any number of outputs.
pub(super) struct Projected<'a> {
    projection: &'a Projection,
    basis: &'a Matrix,
    leverage: Vec<f64>,
}

impl Projected<'_> {
    /// The coefficients `c_t = sum_i w_i y_i psi_t(x_i)` of one output, of which the first belongs to the
    /// constant.
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
        // Under the rule's weights the Gram matrix is the unit matrix.
        let trace = terms as f64 / runs as f64;
        let relative = squares / variance * correction(runs, terms, trace);
        let relative = if relative.is_nan() { f64::INFINITY } else { relative };
        Fit { coefficients, relative, residuals }
    }
}

/// The weight of each run, where each is one node and each node one run; and how many runs are nodes.
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
