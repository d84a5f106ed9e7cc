//! `quadrature`: the nodes of a Gauss rule.

mod rule;
#[cfg(test)]
mod tests;

use lacuna::data::{Parameter, Unit};
use lacuna::math::distribution::Distribution;
use lacuna::math::random::{Stream, uniform};
use lacuna::plugin::{Component, Context, Design};
use lacuna::run::Stop;
use lacuna::text::problem::Complaints;
use lacuna_linalg::Matrix;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::surrogates::polynomial_chaos::{Coordinate, Family, Recurrence};

pub use rule::{Nodes, Rule};

/// Nodes of a Gauss rule, for a `polynomial_chaos` surrogate with `solver = "quadrature"`.
///
/// The first runs are the nodes; further runs are random points, which the surrogate can hold out for validation:
/// with 64 nodes, `runs = 80` here and `training = 64`, `validation = 16` in `[surrogate]`. A rule of level `l`
/// integrates polynomials of total degree up to `2 l + 1` exactly and so determines an expansion of degree `l`. It
/// suits smooth responses of few parameters; no run may fail, because every node has its weight.
///
/// References: Golub and Welsch, Mathematics of Computation 23 (1969) 221; Novak and Ritter, Numerische Mathematik 75
/// (1996) 79.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Quadrature {
    /// Combination of the one-dimensional rules of the parameters.
    pub rule: Rule,
    /// Level of the rule: the tensor rule has `level + 1` nodes per parameter. Default: the highest level with no
    /// more nodes than runs.
    pub level: Option<usize>,
    /// Polynomials of the rule; must equal the surrogate's `basis`.
    pub basis: Family,
}

/// Number of levels that are tried if none is given.
const MOST_LEVELS: usize = 100;

impl Quadrature {
    fn coordinates(
        &self,
        parameters: &[Parameter],
        level: usize,
    ) -> Result<Vec<Coordinate>, String> {
        parameters.iter().map(|p| Coordinate::new(self.basis, p, level + 1)).collect()
    }

    /// Returns the rule of the given level, or else the largest one with no more nodes than runs; `None` if not even
    /// one node fits.
    fn rule(
        &self,
        parameters: &[Parameter],
        runs: usize,
    ) -> Result<Option<(Vec<Coordinate>, Nodes)>, String> {
        let of_level = |level: usize, limit: usize| {
            let coordinates = self.coordinates(parameters, level)?;
            let axes: Vec<Recurrence> =
                coordinates.iter().map(|c| c.recurrence(level + 1)).collect();
            Ok::<_, String>(self.rule.nodes(&axes, level, limit).map(|nodes| (coordinates, nodes)))
        };
        let Some(level) = self.level else {
            let mut found = None;
            for level in 0..MOST_LEVELS {
                // Finitely many moments limit the level: a distribution that lacks them ends the search, and is an
                // error at the first level.
                match of_level(level, runs) {
                    Ok(Some(rule)) => found = Some(rule),
                    Err(fault) if level == 0 => return Err(fault),
                    _ => break,
                }
            }
            return Ok(found);
        };
        if let Some(rule) = of_level(level, runs)? {
            return Ok(Some(rule));
        }
        let name = self.rule.name();
        Err(match of_level(level, 1_000_000)? {
            Some((_, Nodes { weights, .. })) => format!(
                "the {name} rule of level {level} has {} nodes, but the design has {runs} runs",
                weights.len()
            ),
            None => format!("the {name} rule of level {level} has more than a million nodes"),
        })
    }
}

impl Component for Quadrature {
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        let Some(runs) = context.runs else { return };
        if let Err(fault) = self.rule(context.parameters, runs) {
            let help = "give as many `runs` as there are nodes, or lower the `level`";
            complaints.at("level").say(fault).help(help);
        }
    }
}

impl Design for Quadrature {
    fn points(&self, count: usize, dimension: usize, stream: &Stream) -> Result<Matrix, Stop> {
        // Without distributions the coordinates themselves are uniform.
        let parameter = |i: usize| Parameter {
            name: format!("coordinate {}", i + 1),
            symbol: String::new(),
            unit: Unit::dimensionless(),
            design: Distribution::Uniform([0.0, 1.0]),
            prior: Distribution::Uniform([0.0, 1.0]),
            reference: None,
        };
        let parameters: Vec<Parameter> = (0..dimension).map(parameter).collect();
        self.place(&parameters, count, stream)
    }

    fn place(
        &self,
        parameters: &[Parameter],
        count: usize,
        stream: &Stream,
    ) -> Result<Matrix, Stop> {
        let mut points = Matrix::zeros(0, parameters.len());
        if count > 0 && !parameters.is_empty() {
            let rule = self.rule(parameters, count).map_err(Stop::new)?;
            if let Some((coordinates, nodes)) = &rule {
                for node in nodes.points.iter_rows() {
                    let unit = |((z, c), p): ((&f64, &Coordinate), &Parameter)| {
                        // The clamp keeps nodes far out in the tail inside the open cube.
                        p.design.cdf(c.parameter(*z)).clamp(f64::MIN_POSITIVE, 1.0 - 1e-16)
                    };
                    let place: Vec<f64> =
                        node.iter().zip(coordinates).zip(parameters).map(unit).collect();
                    points.push_row(&place);
                }
            }
        }
        for i in points.rows()..count {
            let mut rng = stream.at(i as u64).generator();
            let place: Vec<f64> = parameters.iter().map(|_| uniform(&mut rng)).collect();
            points.push_row(&place);
        }
        Ok(points)
    }

    /// Keeps the nodes and adds random points, like those behind the nodes of any design of this kind. Fails if more
    /// runs would change the rule.
    fn extend(
        &self,
        parameters: &[Parameter],
        known: &Matrix,
        count: usize,
        stream: &Stream,
    ) -> Result<Matrix, Stop> {
        let all = self.place(parameters, known.rows() + count, stream)?;
        if all.as_slice()[..known.as_slice().len()] != *known.as_slice() {
            return Err(Stop::new(
                "the quadrature rule for more runs does not contain the nodes of the existing runs",
            )
            .help("give the `level` of the rule: then further runs are random points"));
        }
        Ok(all.select_rows(&(known.rows()..all.rows()).collect::<Vec<_>>()))
    }
}

lacuna::register!(Design, "quadrature", Quadrature, aliases: ["sparse_grid", "gauss", "smolyak"]);
