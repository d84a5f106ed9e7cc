//! Likelihood of data that state their own noise: `sigma` of each value, or the covariance of a curve.
//!
//! The noise of a curve has the covariance `S` (of the outputs measured), with eigenvectors `Q` and eigenvalues `l`.
//! The unknown scales it, `s S`, or is added to it, `S + v I`; in both cases the components `Q' y` are independent,
//! with the variances `s l` or `l + v` (generalised least squares; Aitken, Proc. Roy. Soc. Edinburgh 55 (1936) 42).
//! Curves that measured the same outputs with the same noise are reduced to count, mean and scatter of each
//! component.

use std::collections::BTreeMap;

use lacuna::data::{Measurements, Replicate};
use lacuna::math::random::{Stream, normal};
use lacuna::plugin::discrepancy::{
    CommonError, ErrorPath, Hyperparameter, Known, Likelihood, VariancePart,
};
use lacuna::run::Stop;
use lacuna_linalg::Matrix;

use super::Gaussian;
use crate::discrepancies::common::{
    Groups, Normal, PerGroup, Replicates, Setting, Unknown, Variance, conditional, squared, start,
};

/// Likelihood with stated noise (see the module).
pub(super) struct StatedLikelihood {
    hyper: Vec<Hyperparameter>,
    setting: Setting,
    groups: Groups,
    variance: PerGroup,
    /// True if the unknown multiplies the stated variances; false if it is added to them.
    scaled: bool,
    sets: Vec<Set>,
    /// Set of each replicate; `None` for one without a value.
    set_of: Vec<Option<usize>>,
    /// Eigenvalues `l` of all components, set by set.
    eigenvalues: Vec<f64>,
    /// Group of each component.
    group_of: Vec<usize>,
    /// Density of the components.
    normal: Normal,
}

/// Curves that measured the same outputs with the same noise.
struct Set {
    outputs: Vec<usize>,
    /// `Q`; `None` if the noise of the values is independent.
    rotation: Option<Matrix>,
    /// Index of its first component.
    begin: usize,
}

impl Set {
    /// Returns `Q' y` of values by output.
    fn components(&self, by_output: impl Fn(usize) -> f64) -> Vec<f64> {
        let own: Vec<f64> = self.outputs.iter().map(|&i| by_output(i)).collect();
        match &self.rotation {
            None => own,
            Some(q) => lacuna_linalg::transposed_multiply_vector(q, &own),
        }
    }

    /// Returns `Q z` by measured output.
    fn values(&self, components: &[f64]) -> Vec<f64> {
        match &self.rotation {
            None => components.to_vec(),
            Some(q) => lacuna_linalg::multiply_vector(q, components),
        }
    }
}

/// Returns true if this likelihood is needed for the stated noise. It is not if the noise is one number per output
/// that the unknown multiplies, because that is a scale of the ordinary likelihood.
pub(super) fn is_needed(options: &Gaussian, data: &Measurements) -> bool {
    let added = matches!(options.variance, Variance::Of(_));
    data.states_noise() && (added || data.covariance.is_some() || differs(data))
}

/// Returns true if two replicates state different noise of one output.
fn differs(data: &Measurements) -> bool {
    (0..data.layout.len()).any(|i| {
        let measured = data.replicates.iter().filter(|r| r.values[i].is_some());
        let mut stated = measured.filter_map(|r| data.stated_variance(r, i));
        stated.next().is_some_and(|first| stated.any(|other| other.to_bits() != first.to_bits()))
    })
}

impl StatedLikelihood {
    pub(super) fn new(options: &Gaussian, known: &Known<'_>) -> Result<Self, Stop> {
        if options.marginal {
            let text =
                "a variance cannot be integrated out where the data state noise of their own";
            return Err(Stop::new(text).help("give `marginal = false`"));
        }
        let data = known.data;
        let replicates = Replicates::of(data, known.common)?;
        let groups = Groups::of(&data.layout, &options.by).map_err(Stop::new)?;
        let groups = groups.with_data(&replicates.measured);
        if data.covariance.is_some() && groups.count() > 1 {
            let text =
                "several variances cannot be estimated if the measurements state a covariance";
            return Err(Stop::new(text).help("give `by = \"all\"`"));
        }
        let mut hyper = Vec::new();
        let (quantity, scaled) = match &options.variance {
            Variance::Of(quantity) => (quantity, false),
            Variance::Measured(quantity) => (quantity, true),
        };
        let unknown = if scaled {
            Unknown { name: "multiplier", unit: lacuna::data::Unit::dimensionless() }
        } else {
            Unknown { name: "variance", unit: squared(&data.layout.unit)? }
        };
        let plain = vec![1.0; data.layout.len()];
        let begin = |g: usize| if scaled { 1.0 } else { start(&groups, &replicates, &plain, g) };
        let variance = PerGroup::new(quantity, &groups, &unknown, begin, &mut hyper);
        let (sets, set_of, members) = sets(data)?;
        let mut eigenvalues = Vec::new();
        let mut group_of = Vec::new();
        let mut made = Vec::new();
        let mut components =
            Replicates { measured: Vec::new(), count: vec![], mean: vec![], scatter: vec![] };
        for (outputs, members) in sets.into_iter().zip(members) {
            let of = &data.replicates[members[0]];
            let (rotation, own) = noise(data, of, &outputs)?;
            let set = Set { outputs, rotation, begin: eigenvalues.len() };
            let curves: Vec<Vec<f64>> = members
                .iter()
                .map(|&r| set.components(|i| data.replicates[r].values[i].unwrap_or(f64::NAN)))
                .collect();
            for k in 0..own.len() {
                let count = curves.len() as f64;
                let mean = curves.iter().map(|curve| curve[k]).sum::<f64>() / count;
                components.measured.push(components.measured.len());
                components.count.push(count);
                components.mean.push(mean);
                components.scatter.push(curves.iter().map(|c| (c[k] - mean).powi(2)).sum());
                let group = if groups.count() > 1 { groups.of[set.outputs[k]] } else { Some(0) };
                group_of.push(group.unwrap_or_default());
            }
            eigenvalues.extend(own);
            made.push(set);
        }
        let common: Vec<CommonError> =
            known.common.iter().map(|error| rotated(error, &made)).collect();
        let normal = Normal::new(&components, &common)?;
        let setting = Setting::new(known, &replicates, &groups);
        let sets = made;
        Ok(Self {
            hyper,
            setting,
            groups,
            variance,
            scaled,
            sets,
            set_of,
            eigenvalues,
            group_of,
            normal,
        })
    }

    /// Returns the variance of each component.
    fn variances(&self, hyper: &[f64]) -> Option<Vec<f64>> {
        let unknown = self.variance.values(hyper)?;
        let one = |(l, &g): (&f64, &usize)| {
            if self.scaled { unknown[g] * l } else { unknown[g] + l }
        };
        Some(self.eigenvalues.iter().zip(&self.group_of).map(one).collect())
    }

    fn components(&self, response: &[f64]) -> Vec<f64> {
        self.sets.iter().flat_map(|set| set.components(|i| response[i])).collect()
    }

    /// Returns the variance of a new replicate at each output, without the common errors.
    fn by_output(&self, hyper: &[f64]) -> Vec<f64> {
        let unknown = self
            .variance
            .values(hyper)
            .map_or_else(|| vec![f64::NAN; self.groups.count()], <[f64]>::to_vec);
        let stated = self.setting.data.stated_sd();
        let one = |(sd, v): (&f64, f64)| if self.scaled { v * sd * sd } else { v + sd * sd };
        stated.iter().zip(self.groups.spread(&unknown)).map(one).collect()
    }
}

/// Outputs of each set of curves, set of each replicate, and replicates of each set.
type Sets = (Vec<Vec<usize>>, Vec<Option<usize>>, Vec<Vec<usize>>);

fn sets(data: &Measurements) -> Result<Sets, Stop> {
    let mut known: BTreeMap<(Vec<usize>, Vec<u64>), usize> = BTreeMap::new();
    let (mut outputs, mut set_of, mut members): Sets = Default::default();
    for (r, replicate) in data.replicates.iter().enumerate() {
        let measured: Vec<usize> =
            (0..replicate.values.len()).filter(|&i| replicate.values[i].is_some()).collect();
        if measured.is_empty() {
            set_of.push(None);
            continue;
        }
        let stated: Option<Vec<u64>> = measured
            .iter()
            .map(|&i| data.stated_variance(replicate, i).filter(|v| *v > 0.0).map(f64::to_bits))
            .collect();
        let name = &replicate.name;
        let stated = stated.ok_or_else(|| {
            Stop::new(format!("replicate `{name}` states the noise of only some of its values"))
        })?;
        let set = *known.entry((measured.clone(), stated)).or_insert(outputs.len());
        if set == outputs.len() {
            outputs.push(measured);
            members.push(Vec::new());
        }
        members[set].push(r);
        set_of.push(Some(set));
    }
    Ok((outputs, set_of, members))
}

/// Returns eigenvectors (`None` if independent) and eigenvalues of the noise of some outputs of a curve; fails if a
/// covariance is not positive definite.
fn noise(
    data: &Measurements,
    replicate: &Replicate,
    outputs: &[usize],
) -> Result<(Option<Matrix>, Vec<f64>), Stop> {
    let Some(covariance) = &data.covariance else {
        let stated = |&i: &usize| data.stated_variance(replicate, i).unwrap_or(f64::NAN);
        return Ok((None, outputs.iter().map(stated).collect()));
    };
    let n = outputs.len();
    let own = Matrix::from_fn(n, n, |i, j| covariance[(outputs[i], outputs[j])]);
    let wrong = |what: String| Stop::new(format!("the covariance of the measurements: {what}"));
    let eigen = lacuna_linalg::symmetric_eigen(&own).map_err(|e| wrong(e.to_string()))?;
    if let Some(least) = eigen.values.iter().find(|l| **l <= 0.0) {
        return Err(wrong(format!("not positive definite, its least eigenvalue is {least:e}")));
    }
    Ok((Some(eigen.vectors), eigen.values))
}

/// Rotates a common error into the components.
fn rotated(error: &CommonError, sets: &[Set]) -> CommonError {
    let columns: Vec<Vec<f64>> = (0..error.factor.columns())
        .map(|k| sets.iter().flat_map(|set| set.components(|i| error.factor[(i, k)])).collect())
        .collect();
    let rows = sets.last().map_or(0, |set| set.begin + set.outputs.len());
    let factor = Matrix::from_fn(rows, columns.len(), |i, k| columns[k][i]);
    CommonError { factor: factor.into(), ..error.clone() }
}

impl Likelihood for StatedLikelihood {
    fn hyperparameters(&self) -> &[Hyperparameter] {
        &self.hyper
    }

    fn log_likelihood(&self, response: &[f64], hyper: &[f64]) -> f64 {
        let Some(variance) = self.variances(hyper) else { return f64::NEG_INFINITY };
        let solved = self.normal.solve(&self.components(response), &variance);
        solved.map_or(f64::NEG_INFINITY, |solved| solved.log_likelihood)
    }

    fn is_cheap(&self) -> bool {
        self.normal.factor.columns() == 0 && self.sets.iter().all(|set| set.rotation.is_none())
    }

    fn gradient(&self, response: &[f64], hyper: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let (mut by_response, mut by_hyper) = (vec![0.0; response.len()], vec![0.0; hyper.len()]);
        let Some(variance) = self.variances(hyper) else { return (by_response, by_hyper) };
        let Some(solved) = self.normal.solve(&self.components(response), &variance) else {
            return (by_response, by_hyper);
        };
        let by_component = self.normal.by_response(&solved, &variance);
        for set in &self.sets {
            let own = &by_component[set.begin..set.begin + set.outputs.len()];
            for (&i, g) in set.outputs.iter().zip(set.values(own)) {
                by_response[i] += g;
            }
        }
        let mut by_group = vec![0.0; self.groups.count()];
        let by_variance = self.normal.by_variance(&solved, &variance);
        for ((slope, l), &g) in by_variance.iter().zip(&self.eigenvalues).zip(&self.group_of) {
            by_group[g] += if self.scaled { slope * l } else { *slope };
        }
        self.variance.add_gradient(&by_group, &mut by_hyper);
        (by_response, by_hyper)
    }

    /// Computed only for independent noise.
    fn left_out(&self, response: &[f64], hyper: &[f64]) -> Option<Vec<f64>> {
        if self.sets.iter().any(|set| set.rotation.is_some()) {
            return None;
        }
        let variance = self.variances(hyper)?;
        let components = self.components(response);
        let solved = self.normal.solve(&components, &variance)?;
        let spread = self.normal.spread(&solved);
        let residual = self.normal.replicates.residual(&components);
        let mut all = Vec::new();
        for (replicate, set) in self.setting.data.replicates.iter().zip(&self.set_of) {
            let Some(set) = set.map(|set| &self.sets[set]) else { continue };
            for (k, &i) in (set.begin..).zip(&set.outputs) {
                let common = residual[k] - solved.error[k];
                let y = replicate.values[i].unwrap_or(f64::NAN);
                let pull = (y - response[i] - common) / variance[k];
                all.push(conditional(pull, (1.0 - spread[k] / variance[k]) / variance[k]));
            }
        }
        Some(all)
    }

    fn predictive(&self, _: &[f64], hyper: &[f64]) -> Vec<VariancePart> {
        self.setting.parts(&self.by_output(hyper))
    }

    /// A stated covariance holds for a curve in which every output was measured; without one the noise is independent.
    fn errors(&self, _: &[f64], hyper: &[f64], stream: &Stream) -> Vec<ErrorPath> {
        let whole = self.by_output(hyper);
        let complete = |set: &&Set| set.rotation.is_some() && set.outputs.len() == whole.len();
        let set = self.sets.iter().find(complete).zip(self.variances(hyper));
        self.setting.errors_by(&whole, stream, |part, stream| {
            let Some((set, variance)) = &set else { return part.independent(stream) };
            let own = &variance[set.begin..set.begin + set.outputs.len()];
            let mut rng = stream.generator();
            let components: Vec<f64> = own.iter().map(|v| v.sqrt() * normal(&mut rng)).collect();
            let mut values = vec![0.0; whole.len()];
            for (&i, e) in set.outputs.iter().zip(set.values(&components)) {
                values[i] = e * (part.variance[i] / whole[i]).sqrt();
            }
            ErrorPath { origin: part.origin.clone(), values }
        })
    }

    fn simulate(&self, response: &[f64], hyper: &[f64], stream: &Stream) -> Vec<Measurements> {
        let mean = self.setting.with_common_errors(response, stream);
        let variance = self.variances(hyper).unwrap_or_default();
        let mut data = self.setting.data.clone();
        for (r, (replicate, set)) in data.replicates.iter_mut().zip(&self.set_of).enumerate() {
            let Some(set) = set.map(|set| &self.sets[set]) else { continue };
            let mut rng = stream.named("replicate").at(r as u64).generator();
            let own = &variance[set.begin..set.begin + set.outputs.len()];
            let components: Vec<f64> = own.iter().map(|v| v.sqrt() * normal(&mut rng)).collect();
            for (&i, e) in set.outputs.iter().zip(set.values(&components)) {
                replicate.values[i] = Some(mean[i] + e);
            }
        }
        vec![data]
    }

    fn facts(&self) -> Vec<lacuna::plugin::Fact> {
        let curves = self.set_of.iter().flatten().count();
        let stated = self.eigenvalues.iter().sum::<f64>() / self.eigenvalues.len().max(1) as f64;
        let rms = stated.sqrt();
        let unit = &self.setting.data.layout.unit;
        let text = format!("{curves} curves, {rms:.3e} {unit} root mean square");
        vec![lacuna::plugin::Fact::new("stated noise", text)]
    }
}
