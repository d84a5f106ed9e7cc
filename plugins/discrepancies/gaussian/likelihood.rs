//! Likelihood in the sufficient statistics of the replicates.

use std::f64::consts::TAU;
use std::sync::{Arc, OnceLock};

use lacuna::data::Measurements;
use lacuna::data::measurements::Summary;
use lacuna::math::random::{Stream, uniform};
use lacuna::plugin::Fact;
use lacuna::plugin::discrepancy::{
    Compressed, ErrorPath, Hyperparameter, Known, Likelihood, VariancePart,
};
use lacuna::plugin::forward::Linear;
use lacuna::run::Stop;
use lacuna_linalg::Matrix;
use lacuna_linalg::vector::dot;

use super::Gaussian;
use super::compressed::CompressedGaussian;
use super::law::{Coupled, Law};
use super::memory::Memory;
use super::statistics::{Directions, Residual, Spread, Statistics};
use crate::discrepancies::common::{Noise, Normal, Replicates, values};

/// The likelihood (see the module).
pub(super) struct GaussianLikelihood {
    hyper: Vec<Hyperparameter>,
    noise: Noise,
    pub(super) groups: Vec<Statistics>,
    pub(super) law: Law,
    /// Density output by output, if common errors couple the groups; made when it is asked for.
    normal: OnceLock<Option<Normal>>,
    /// Directions of the common errors for parts of the data.
    memory: Memory,
}

/// Number of responses whose residuals are split together, so that they stay in the cache.
const TOGETHER: usize = 16;

/// Residual of each group: components along the directions, and the remaining vector.
type Split = Vec<(Vec<f64>, Vec<f64>)>;

impl GaussianLikelihood {
    pub(super) fn new(options: &Gaussian, known: &Known<'_>) -> Result<Self, Stop> {
        Self::under(options, known, known.data)
    }

    /// Builds the likelihood of `known.data`, with measured variances taken from the replicates of `shown`.
    pub(super) fn under(
        options: &Gaussian,
        known: &Known<'_>,
        shown: &Measurements,
    ) -> Result<Self, Stop> {
        let replicates = Replicates::of(known.data, known.common)?;
        let mut hyper = Vec::new();
        let noise =
            Noise::new(known, shown, &replicates, (&options.variance, &options.by), &mut hyper)?;
        let count = noise.groups.count();
        let common = known.common;
        let coupled = count > 1 && common.iter().any(|e| e.factor.columns() > 0);
        let mut groups = Vec::with_capacity(count);
        for g in 0..count {
            let own = |i: usize| noise.groups.of[i] == Some(g);
            groups.push(if count == 1 {
                Statistics::of(&replicates, common, &noise.scale, own)?
            } else {
                Statistics::without_common(&replicates, &noise.scale, own)
            });
        }
        let law = match (options.marginal, options.variance.prior()) {
            (true, Some(_)) if coupled => return Err(not_integrable()),
            (true, Some(prior)) => {
                hyper.clear();
                Law::Integrated(prior.clone())
            }
            _ if coupled => {
                Law::Coupled(Coupled::new(&mut groups, common, noise.variance.clone())?)
            }
            _ => Law::Given(noise.variance.clone()),
        };
        let (normal, memory) = (OnceLock::new(), Memory::default());
        Ok(Self { hyper, noise, groups, law, normal, memory })
    }

    /// Density output by output, if common errors couple the groups.
    fn normal(&self) -> Option<&Normal> {
        match &self.law {
            Law::Coupled(_) => self.normal.get_or_init(|| self.noise.normal()).as_ref(),
            _ => None,
        }
    }

    #[cfg(test)]
    pub(super) fn noise(&self) -> &Noise {
        &self.noise
    }

    pub(super) fn spreads(&self) -> Vec<&Spread> {
        self.groups.iter().map(|g| &g.spread).collect()
    }

    fn split(&self, response: &[f64]) -> Split {
        self.groups.iter().flat_map(|g| g.split(&[response])).collect()
    }

    /// Directions of the common errors for the weights of a part of the data; `None` if they couple several groups, whose
    /// factors a part would need too.
    fn other_directions(&self, part: &Statistics) -> Option<Arc<Directions>> {
        let common = &self.noise.setting.common;
        let make = || part.common_directions(common).ok();
        match &self.law {
            Law::Coupled(_) => None,
            _ if self.groups.len() > 1 => Some(Arc::clone(&part.common)),
            _ => self.memory.directions(&part.weight, make),
        }
    }

    /// Returns the variance of each group given the response, as pairs of values and probabilities.
    fn variances(&self, response: &[f64], hyper: &[f64]) -> Option<Vec<Vec<(f64, f64)>>> {
        let split = if self.law.learns_variances() { self.split(response) } else { Vec::new() };
        self.law.variances(&self.spreads(), hyper, &residuals(&split))
    }

    /// Returns the mean of the variance of each output.
    fn mean_variance(&self, response: &[f64], hyper: &[f64]) -> Vec<f64> {
        let mean = |nodes: &Vec<(f64, f64)>| nodes.iter().map(|(v, p)| v * p).sum::<f64>();
        let groups = self.variances(response, hyper).unwrap_or_default();
        self.noise.by_output(&groups.iter().map(mean).collect::<Vec<f64>>())
    }

    /// Returns the variance of each output, drawn from its posterior given the data and this response if it is integrated
    /// out.
    fn drawn_variance(&self, response: &[f64], hyper: &[f64], stream: &Stream) -> Vec<f64> {
        let mut rng = stream.named("variance").generator();
        let groups = self.variances(response, hyper).unwrap_or_default();
        let mut draw = |nodes: &Vec<(f64, f64)>| {
            let mut left = if nodes.len() > 1 { uniform(&mut rng) } else { 0.0 };
            let chosen = nodes.iter().find(|(_, p)| {
                left -= p;
                left <= 0.0
            });
            chosen.or(nodes.last()).map_or(0.0, |node| node.0)
        };
        let variance: Vec<f64> = groups.iter().map(&mut draw).collect();
        self.noise.by_output(&variance)
    }

    /// Returns the contribution of the common errors to the density of a value given all others, for each variance
    /// (row) and measured output of the group (column): the expected error, and the reduction of the precision.
    fn shares(group: &Statistics, along: &[f64], nodes: &[(f64, f64)]) -> (Matrix, Matrix) {
        let values = &group.spread.eigenvalues;
        let share =
            Matrix::from_fn(nodes.len(), values.len(), |n, r| values[r] / (nodes[n].0 + values[r]));
        let pulled =
            Matrix::from_fn(share.rows(), share.columns(), |n, r| share[(n, r)] * along[r]);
        let directions = &group.common.rows;
        let squares = Matrix::from_fn(directions.rows(), directions.columns(), |r, k| {
            directions[(r, k)] * directions[(r, k)]
        });
        (lacuna_linalg::multiply(&pulled, directions), lacuna_linalg::multiply(&share, &squares))
    }

    /// Returns the log density of each of these values, given with their outputs, given all others.
    fn left_out_of_values(
        &self,
        response: &[f64],
        hyper: &[f64],
        values: impl Iterator<Item = (usize, f64)>,
    ) -> Option<Vec<f64>> {
        let split = self.split(response);
        let nodes = self.law.variances(&self.spreads(), hyper, &residuals(&split))?;
        let mut place = vec![(0, 0); response.len()];
        for (g, group) in self.groups.iter().enumerate() {
            group.measured.iter().enumerate().for_each(|(k, &i)| place[i] = (g, k));
        }
        let groups = self.groups.iter().zip(&split).zip(&nodes);
        let shares: Vec<_> =
            groups.map(|((group, (along, _)), nodes)| Self::shares(group, along, nodes)).collect();
        let one = |(i, y): (usize, f64)| {
            let (g, k) = place[i];
            let (group, scale) = (&self.groups[g], &self.noise.scale);
            Self::left_out_of(group, &shares[g], scale, k, &nodes[g], y - response[i])
        };
        Some(values.map(one).collect())
    }

    /// Returns the log density of a value of the `k`-th measured output given all others; `difference` is the value
    /// minus the response.
    fn left_out_of(
        group: &Statistics,
        (common, shrink): &(Matrix, Matrix),
        scale: &[f64],
        k: usize,
        nodes: &[(f64, f64)],
        difference: f64,
    ) -> f64 {
        let scale = scale[group.measured[k]];
        let count = group.weight[k].powi(2) * scale;
        let (own, root) = (difference / scale.sqrt(), count.sqrt());
        // With an uncertain variance, the density of a value given the others is the reciprocal of the mean of its
        // reciprocal density over the variance: here its exponent and the factor before it, at each variance.
        let reciprocal = |(n, &(v, p)): (usize, &(f64, f64))| {
            let pull = (own - common[(n, k)] / root) / v;
            let precision = (1.0 - shrink[(n, k)] / count) / v;
            (0.5 * pull * pull / precision, p * (TAU / precision).sqrt())
        };
        let all = || nodes.iter().enumerate().map(reciprocal);
        let largest = all().fold(f64::NEG_INFINITY, |largest, (exponent, _)| largest.max(exponent));
        let sum: f64 = all().map(|(exponent, p)| p * (exponent - largest).exp()).sum();
        -largest - sum.ln() - 0.5 * scale.ln()
    }
}

fn residuals(split: &Split) -> Vec<Residual<'_>> {
    split
        .iter()
        .map(|(along, outside)| Residual { outside: dot(outside, outside), along })
        .collect()
}

/// Message for `marginal` with several groups and common errors.
pub(super) const SEVERAL: &str =
    "several variances cannot be integrated out together with errors that all replicates share";

fn not_integrable() -> Stop {
    Stop::new(SEVERAL)
        .help("give `marginal = false`, or one variance for all outputs (`by = \"all\"`)")
}

impl Likelihood for GaussianLikelihood {
    fn hyperparameters(&self) -> &[Hyperparameter] {
        &self.hyper
    }

    fn log_likelihood(&self, response: &[f64], hyper: &[f64]) -> f64 {
        let split = self.split(response);
        self.law.log_likelihood(&self.spreads(), hyper, &residuals(&split))
    }

    /// The directions of the common errors are those of the first part with the same number of replicates of each output.
    fn of_part(&self, part: &Measurements) -> Option<Box<dyn Likelihood>> {
        let replicates = Replicates::of(part, &[]).ok()?;
        let scale = &self.noise.scale;
        let directions = |part: &Statistics| self.other_directions(part);
        let groups = self.groups.iter().map(|g| g.of_part(&replicates, scale, directions));
        let groups = groups.collect::<Option<Vec<Statistics>>>()?;
        Some(Box::new(Self {
            hyper: self.hyper.clone(),
            law: self.law.clone(),
            noise: self.noise.of_part(part, &replicates),
            groups,
            normal: OnceLock::new(),
            memory: Memory::default(),
        }))
    }

    fn log_likelihoods(&self, responses: &Matrix, hyper: &Matrix) -> Vec<f64> {
        let rows: Vec<&[f64]> = responses.iter_rows().collect();
        let spreads = self.spreads();
        let mut all = Vec::with_capacity(rows.len());
        for some in rows.chunks(TOGETHER) {
            let mut splits: Vec<_> =
                self.groups.iter().map(|g| g.split(some).into_iter()).collect();
            for _ in some {
                let split: Split = splits.iter_mut().filter_map(Iterator::next).collect();
                let own = hyper.row(all.len());
                all.push(self.law.log_likelihood(&spreads, own, &residuals(&split)));
            }
        }
        all
    }

    fn gradient(&self, response: &[f64], hyper: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let split = self.split(response);
        let mut by_response = vec![0.0; response.len()];
        let Some(slopes) = self.law.slopes(&self.spreads(), hyper, &residuals(&split)) else {
            return (by_response, vec![0.0; hyper.len()]);
        };
        for (g, (group, (_, outside))) in self.groups.iter().zip(&split).enumerate() {
            let mut pull: Vec<f64> = outside.iter().map(|z| z / slopes.outside[g]).collect();
            for (direction, a) in group.common.rows.iter_rows().zip(&slopes.along[g]) {
                for (p, u) in pull.iter_mut().zip(direction) {
                    *p += u * a;
                }
            }
            for ((&i, w), p) in group.measured.iter().zip(&group.weight).zip(&pull) {
                by_response[i] = w * p;
            }
        }
        (by_response, slopes.by_hyper)
    }

    fn left_out(&self, response: &[f64], hyper: &[f64]) -> Option<Vec<f64>> {
        let data = &self.noise.setting.data;
        if let Some(normal) = self.normal() {
            let groups = self.noise.variance.values(hyper)?;
            let variance = self.noise.by_measured(&normal.replicates, groups);
            let solved = normal.solve(response, &variance)?;
            return Some(normal.left_out(&solved, data, response, &variance));
        }
        self.left_out_of_values(response, hyper, values(data))
    }

    fn left_out_at(&self, response: &[f64], hyper: &[f64], data: &[usize]) -> Option<Vec<f64>> {
        if self.normal().is_some() {
            let all = self.left_out(response, hyper)?;
            return data.iter().map(|&i| all.get(i).copied()).collect();
        }
        self.left_out_of_values(response, hyper, self.noise.setting.values_at(data).into_iter())
    }

    fn is_cheap(&self) -> bool {
        !matches!(self.law, Law::Coupled(_))
    }

    fn compress(&self, linear: &dyn Linear) -> Option<Box<dyn Compressed>> {
        Some(Box::new(CompressedGaussian::new(self, linear).ok()?))
    }

    fn predictive(&self, response: &[f64], hyper: &[f64]) -> Vec<VariancePart> {
        self.noise.setting.parts(&self.mean_variance(response, hyper))
    }

    /// Variances that are integrated out have their posterior mean.
    fn errors(&self, response: &[f64], hyper: &[f64], stream: &Stream) -> Vec<ErrorPath> {
        self.noise.setting.errors(&self.mean_variance(response, hyper), stream)
    }

    /// Variances that are integrated out are drawn from their posterior given the data and this response.
    fn simulate(&self, response: &[f64], hyper: &[f64], stream: &Stream) -> Vec<Measurements> {
        let variance = self.drawn_variance(response, hyper, stream);
        vec![self.noise.setting.simulate(response, &variance, stream)]
    }

    fn simulate_summaries(
        &self,
        response: &[f64],
        hyper: &[f64],
        stream: &Stream,
    ) -> Option<Vec<Vec<Summary>>> {
        let variance = self.drawn_variance(response, hyper, stream);
        Some(vec![self.noise.setting.simulate_summaries(response, &variance, stream)?])
    }

    fn facts(&self) -> Vec<Fact> {
        let directions: usize = match self.normal() {
            Some(normal) => normal.factor.columns(),
            None => self.groups.iter().map(|g| g.common.rows.rows()).sum(),
        };
        vec![
            Fact::new("data", self.groups.iter().map(|g| g.spread.count).sum::<f64>()),
            Fact::new(
                "measured outputs",
                self.groups.iter().map(|g| g.measured.len()).sum::<usize>(),
            ),
            Fact::new("directions of the common errors", directions),
        ]
    }
}
