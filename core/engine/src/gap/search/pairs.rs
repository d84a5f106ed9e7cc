//! Pairs of placements, where no single one helps: all pairs among the placements of largest score are screened by the
//! score of both together, and the best are refitted.
//!
//! With `t` the scores of two regressors of unit length and `g` their product, the squared score of both together is
//! `(t1^2 + t2^2 - 2 g t1 t2) / (1 - g^2)`, and their sizes are `(t1 - g t2) / (1 - g^2)` and the same with the indices
//! exchanged: two effects that hide each other show together.

use lacuna::math::random::Stream;
use lacuna_linalg::vector::dot;
use lacuna_linalg::{Matrix, multiply_transposed};
use rayon::prelude::*;

use super::forward::Search;
use super::refit::{FAR, RefitSetting, Weighed};
use super::state::SearchState;
use super::visited::VisitedModel;
use crate::gap::candidates::Placement;
use crate::gap::system::fit::{fit, fit_above};
use crate::gap::test::{DesignMatrix, Projection};

/// The number of placements of which all pairs are screened.
const SCREENED: usize = 100;

/// The number of pairs that are refitted.
const REFITTED: usize = 16;

/// The number of pairs whose evidence is computed with all corrections.
const WEIGHED: usize = 3;

/// Regressors whose product is larger are the same.
const SAME: f64 = 0.99;

/// A placement in a pair: its regressor, projected and of unit length.
struct Part {
    placement: Placement,
    /// The unknowns from which a fit starts.
    start: Vec<f64>,
    /// The size at absence, and the length of the regressor per unit of size.
    absent: f64,
    length: f64,
    sign: f64,
    log_prior: f64,
    row: Vec<f64>,
    score: f64,
}

/// Two placements with the fit of both.
pub(super) struct Pair {
    /// The placements with the values of their unknowns.
    pub parts: [(Placement, Vec<f64>); 2],
    /// The log evidence plus the log prior mass, without that of one type.
    pub log_weight: f64,
    /// The energy of the gap that is left.
    pub gap: f64,
}

impl Pair {
    /// The model of a state with this pair. `beyond` is the log weight of the state over that of no further effect.
    pub fn visited(
        &self,
        search: &Search<'_>,
        state: &SearchState<'_>,
        beyond: f64,
    ) -> VisitedModel {
        let placements = state.chosen.iter().chain(self.parts.iter().map(|(p, _)| p));
        VisitedModel::of(search.candidates, placements, self.log_weight + beyond)
    }
}

impl<'a> Search<'a> {
    /// The pairs of largest weight beside the effects of a state, in decreasing order. The log weights are on the scale
    /// of those of `weighed`.
    pub(super) fn pairs(
        &self,
        state: &SearchState<'a>,
        weighed: &[Weighed],
        design: &DesignMatrix,
        projection: &Projection,
        stream: &Stream,
    ) -> Vec<Pair> {
        let common = self.setting();
        let setting = state.refit_setting(&common);
        let residual = projection.rest(&state.fit.residual);
        let parts = self.parts(&setting, state, weighed, design, projection, &residual);
        let best = screened(&parts);
        // A pair that does not come near to the best single placement is not accurate.
        let alone = weighed.iter().map(|one| one.fit.log_density).fold(f64::NEG_INFINITY, f64::max);
        let fitted: Vec<(f64, Pair)> = best
            .par_iter()
            .filter_map(|&(i, j, sizes)| {
                Self::fitted(&setting, state, [&parts[i], &parts[j]], sizes, alone - FAR)
            })
            .collect();
        let mut order: Vec<usize> = (0..fitted.len()).collect();
        order.sort_by(|&a, &b| fitted[b].0.total_cmp(&fitted[a].0));
        order.truncate(WEIGHED);
        let mut pairs: Vec<Pair> = order
            .into_par_iter()
            .map(|k| {
                let Pair { parts, .. } = &fitted[k].1;
                let one = setting.with(&parts[0].0);
                let both = RefitSetting { system: &one, ..setting }.with(&parts[1].0);
                let own = parts.iter().flat_map(|(_, own)| own);
                let point: Vec<f64> = state.fit.at.point.iter().chain(own).copied().collect();
                let fit = fit(&both, setting.whitener, setting.means, &point);
                let evidence = setting.weigh(&both, &fit, &stream.named("pairs").at(k as u64));
                let prior: f64 = parts.iter().map(|(p, _)| setting.log_prior(p)).sum();
                let log_weight = evidence.value + prior - self.kinds();
                Pair { parts: parts.clone(), log_weight, gap: evidence.gap }
            })
            .collect();
        pairs.sort_by(|a, b| b.log_weight.total_cmp(&a.log_weight));
        pairs
    }

    /// The placements of largest score with their best regressors, and the refitted ones with their own.
    fn parts(
        &self,
        setting: &RefitSetting<'a, '_>,
        state: &SearchState<'a>,
        weighed: &[Weighed],
        design: &DesignMatrix,
        projection: &Projection,
        residual: &[f64],
    ) -> Vec<Part> {
        let layout = &self.experiment.layouts.blocks[0];
        let absent = |p: &Placement| self.candidates[p.candidate].effect.absent(layout)[0];
        let mut best: Vec<Option<(f64, usize)>> = vec![None; self.placements.len()];
        for (j, regressor) in design.regressors.iter().enumerate() {
            // A second effect of the same type in the same place would not be identifiable.
            if state.chosen.iter().any(|chosen| chosen.is(&self.placements[regressor.placement])) {
                continue;
            }
            let strength = regressor.strength(dot(design.rows.row(j), residual));
            let own = &mut best[regressor.placement];
            if own.is_none_or(|(most, _)| strength > most) {
                *own = Some((strength, j));
            }
        }
        let mut ordered: Vec<(f64, usize)> = best.into_iter().flatten().collect();
        ordered.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        ordered.truncate(SCREENED);
        let scored = ordered.into_iter().map(|(_, j)| {
            let regressor = &design.regressors[j];
            let placement = self.placements[regressor.placement].clone();
            let row = design.rows.row(j).to_vec();
            Part {
                absent: absent(&placement),
                log_prior: setting.log_prior(&placement),
                start: regressor.start.clone(),
                length: regressor.length,
                sign: regressor.sign,
                score: dot(&row, residual),
                placement,
                row,
            }
        });
        let mut parts: Vec<Part> = scored.collect();
        let begin = state.fit.at.point.len();
        for one in weighed {
            if parts.iter().any(|part| part.placement.is(&one.placement)) {
                continue;
            }
            let slope = Matrix::from_rows(residual.len(), [one.fit.slopes.row(begin)]);
            let (left, squares) = projection.rest_of_rows(slope);
            let length = squares[0].max(f64::MIN_POSITIVE).sqrt();
            let row: Vec<f64> = left.row(0).iter().map(|x| x / length).collect();
            let (absent, start) = (absent(&one.placement), one.fit.at.point[begin..].to_vec());
            parts.push(Part {
                sign: 0.0,
                log_prior: setting.log_prior(&one.placement),
                placement: one.placement.clone(),
                score: dot(&row, residual),
                absent,
                start,
                length,
                row,
            });
        }
        parts
    }

    /// A pair fitted from its sizes, with its weight by Laplace's method.
    fn fitted(
        setting: &RefitSetting<'a, '_>,
        state: &SearchState<'a>,
        parts: [&Part; 2],
        sizes: [f64; 2],
        of_interest: f64,
    ) -> Option<(f64, Pair)> {
        let one = setting.with(&parts[0].placement);
        let both = RefitSetting { system: &one, ..*setting }.with(&parts[1].placement);
        let bounds = both.bounds();
        let mut point = state.fit.at.point.clone();
        for (part, size) in parts.iter().zip(sizes) {
            point.push(part.absent + size / part.length);
            point.extend(&part.start[1..]);
        }
        for (x, (low, high)) in point.iter_mut().zip(&bounds) {
            *x = x.clamp(*low, *high);
        }
        let fit = fit_above(of_interest, &both, setting.whitener, setting.means, &point);
        let prior = parts[0].log_prior + parts[1].log_prior;
        let log_weight = setting.white.glance(&fit)? + prior;
        let begin = state.fit.at.point.len();
        let (first, second) = fit.at.point[begin..].split_at(parts[0].start.len());
        let parts = [
            (parts[0].placement.clone(), first.to_vec()),
            (parts[1].placement.clone(), second.to_vec()),
        ];
        Some((log_weight, Pair { parts, log_weight, gap: f64::INFINITY }))
    }
}

/// Two parts by their indices, with their sizes in standard errors.
type Joint = (usize, usize, [f64; 2]);

/// The pairs of largest score with their prior masses, each with the sizes of both in standard errors.
fn screened(parts: &[Part]) -> Vec<Joint> {
    let outputs = parts.first().map_or(0, |part| part.row.len());
    let rows = Matrix::from_rows(outputs, parts.iter().map(|part| part.row.as_slice()));
    let gram = multiply_transposed(&rows, &rows);
    let mut all: Vec<(f64, Joint)> = Vec::new();
    for i in 0..parts.len() {
        for j in i + 1..parts.len() {
            let (a, b) = (&parts[i], &parts[j]);
            let g = gram[(i, j)];
            if g.abs() > SAME || a.placement.is(&b.placement) {
                continue;
            }
            let rest = 1.0 - g * g;
            let sizes = [(a.score - g * b.score) / rest, (b.score - g * a.score) / rest];
            let allowed = sizes[0] * a.sign >= 0.0 && sizes[1] * b.sign >= 0.0;
            if allowed {
                let square = sizes[0] * a.score + sizes[1] * b.score;
                all.push((0.5 * square + a.log_prior + b.log_prior, (i, j, sizes)));
            }
        }
    }
    all.sort_by(|a, b| b.0.total_cmp(&a.0).then((a.1.0, a.1.1).cmp(&(b.1.0, b.1.1))));
    all.truncate(REFITTED);
    all.into_iter().map(|(_, pair)| pair).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use lacuna::plugin::effect::On;
    use lacuna_linalg::Cholesky;

    fn part(candidate: usize, row: Vec<f64>, residual: &[f64]) -> Part {
        Part {
            placement: Placement { candidate, on: On::new() },
            start: vec![1.0],
            absent: 0.0,
            length: 1.0,
            sign: 0.0,
            log_prior: 0.0,
            score: dot(&row, residual),
            row,
        }
    }

    /// Two regressors that nearly cancel in the residual, and have small scores, explain it exactly together: their sizes
    /// are those of least squares, here from the normal equations.
    #[test]
    fn two_effects_that_hide_each_other_are_found_together() {
        let unit = |x: [f64; 4]| {
            let norm = dot(&x, &x).sqrt();
            x.map(|v| v / norm).to_vec()
        };
        let rows =
            [unit([1.0, 0.3, 0.0, 0.0]), unit([1.0, -0.2, 0.1, 0.0]), unit([0.0, 0.5, 0.0, 1.0])];
        let residual: Vec<f64> = (0..4).map(|i| 5.0 * rows[0][i] - 5.1 * rows[1][i]).collect();
        let parts: Vec<Part> =
            rows.iter().enumerate().map(|(c, row)| part(c, row.clone(), &residual)).collect();
        let (i, j, sizes) = screened(&parts)[0];
        assert_eq!((i, j), (0, 1));
        let normal = Matrix::from_fn(2, 2, |a, b| dot(&rows[a], &rows[b]));
        let mut exact: Vec<f64> = (0..2).map(|a| dot(&rows[a], &residual)).collect();
        Cholesky::new(&normal).map(|factor| factor.solve(&mut exact)).ok();
        for (size, exact) in sizes.iter().zip(exact) {
            assert!((size - exact).abs() < 1e-9, "{size} {exact}");
        }
        let alone = [0, 1].map(|k: usize| parts[k].score.abs());
        assert!(alone.iter().all(|score| *score < parts[2].score), "{alone:?}");
    }
}
