//! Gauss rules in several variables.

use std::collections::BTreeMap;

use lacuna_linalg::Matrix;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::surrogates::polynomial_chaos::{Nested, Recurrence, Truncation};

/// Combination of one-dimensional rules.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Rule {
    /// All combinations of `level + 1` Gauss nodes of each parameter.
    #[default]
    Tensor,
    /// Smolyak's sum of small products of Gauss rules: exact for polynomials of the same total degree, up to
    /// `2 level + 1`, with far fewer nodes for four parameters or more. Some weights are negative.
    Smolyak,
}

/// Nodes, one per row in standard variables, and their weights, which sum to 1.
#[derive(Debug, Clone, PartialEq)]
pub struct Nodes {
    /// Nodes (`nodes x parameters`).
    pub points: Matrix,
    /// Weights, one per node.
    pub weights: Vec<f64>,
}

/// Weight below which a node is dropped: a rounding residue of terms that cancel.
const NOTHING: f64 = 1e-14;

impl Rule {
    /// Returns the name of the rule in a study.
    pub fn name(self) -> &'static str {
        match self {
            Self::Tensor => "tensor",
            Self::Smolyak => "smolyak",
        }
    }

    /// Returns the rule of a level, exact for polynomials of total degree up to `2 level + 1` under the distributions
    /// to which the polynomials of `axes` are orthogonal (one recurrence per axis, at least to degree `level + 1`);
    /// `None` if it has more than `limit` nodes.
    ///
    /// Source: Smolyak's formula as in Novak and Ritter, Numerische Mathematik 75 (1996) 79, with `k + 1` Gauss nodes
    /// at level `k`.
    pub fn nodes(self, axes: &[Recurrence], level: usize, limit: usize) -> Option<Nodes> {
        let d = axes.len();
        let tables: Vec<Axis> = axes.iter().map(|a| Axis::new(a, level)).collect::<Option<_>>()?;
        let mut sums: BTreeMap<Vec<usize>, f64> = BTreeMap::new();
        for (levels, share) in self.products(d, level, limit)? {
            if !add_product(&mut sums, &tables, &levels, share, limit) {
                return None;
            }
        }
        sums.retain(|_, weight| weight.abs() > NOTHING);
        let points = sums.keys().map(|ids| {
            ids.iter().zip(&tables).map(|(&id, table)| table.nodes[id]).collect::<Vec<f64>>()
        });
        Some(Nodes { points: Matrix::from_rows(d, points), weights: sums.into_values().collect() })
    }

    /// Returns the levels of each axis in the products, and the coefficient of each product; `None` if there are far
    /// too many.
    fn products(self, d: usize, level: usize, limit: usize) -> Option<Vec<(Vec<usize>, f64)>> {
        if self == Self::Tensor {
            let count = u32::try_from(d).ok().and_then(|d| (level + 1).checked_pow(d));
            return count.filter(|&n| n <= limit).map(|_| vec![(vec![level; d], 1.0)]);
        }
        let all = Truncation { q_norm: 1.0, max_interaction: d };
        // Each product has at least one node of its own level.
        let nested = Nested::new(d, level, all, limit.saturating_mul(2).max(1));
        if nested.counts.len() <= level {
            return None;
        }
        let choose =
            |k: usize| (0..k).map(|i| (d - 1 - i) as f64 / (i + 1) as f64).product::<f64>();
        let product = |t: usize| {
            let levels: Vec<usize> = nested.terms.term(t).iter().map(|&k| usize::from(k)).collect();
            let left = level - levels.iter().sum::<usize>();
            let sign = if left.is_multiple_of(2) { 1.0 } else { -1.0 };
            (left < d).then(|| (levels, sign * choose(left)))
        };
        Some((0..nested.terms.len()).filter_map(product).collect())
    }
}

/// Distinct nodes of the rules of one axis; each rule lists the indices of its nodes and their weights.
struct Axis {
    nodes: Vec<f64>,
    rules: Vec<Vec<(usize, f64)>>,
}

impl Axis {
    fn new(recurrence: &Recurrence, level: usize) -> Option<Self> {
        let rules: Vec<Vec<(f64, f64)>> =
            (0..=level).map(|k| recurrence.gauss(k + 1)).collect::<Option<_>>()?;
        let mut nodes: Vec<f64> = rules.iter().flatten().map(|(z, _)| *z).collect();
        nodes.sort_by(f64::total_cmp);
        // Nodes that are equal up to rounding, such as the centres of symmetric rules.
        nodes.dedup_by(|a, b| (*a - *b).abs() < 1e-9 * (1.0 + b.abs()));
        let id = |z: f64| {
            let above = nodes.partition_point(|&n| n < z);
            let near = |i: &usize| nodes.get(*i).map_or(f64::INFINITY, |n| (n - z).abs());
            [above.saturating_sub(1), above]
                .into_iter()
                .min_by(|i, j| near(i).total_cmp(&near(j)))
                .unwrap_or(above)
        };
        let rules = rules
            .iter()
            .map(|rule| rule.iter().map(|&(z, weight)| (id(z), weight)).collect())
            .collect();
        Some(Self { nodes, rules })
    }
}

/// Adds the product of one rule per axis; returns false if there are more nodes than allowed.
fn add_product(
    sums: &mut BTreeMap<Vec<usize>, f64>,
    tables: &[Axis],
    levels: &[usize],
    share: f64,
    limit: usize,
) -> bool {
    let mut partial = vec![(Vec::new(), share)];
    for (table, &level) in tables.iter().zip(levels) {
        let mut longer = Vec::with_capacity(partial.len() * (level + 1));
        for (ids, weight) in &partial {
            for &(id, w) in &table.rules[level] {
                longer.push(([&ids[..], &[id]].concat(), weight * w));
            }
        }
        if longer.len() > limit {
            return false;
        }
        partial = longer;
    }
    for (ids, weight) in partial {
        *sums.entry(ids).or_insert(0.0) += weight;
    }
    sums.len() <= limit
}
