//! Likelihood of independent Student's t values.

use std::f64::consts::PI;

use lacuna::data::{Measurements, Unit};
use lacuna::math::distribution::Distribution;
use lacuna::math::random::{Stream, normal};
use lacuna::math::special::ln_gamma;
use lacuna::plugin::Fact;
use lacuna::plugin::discrepancy::{
    ErrorPath, Hyperparameter, Known, Likelihood, SampledErrors, VariancePart,
};
use lacuna::run::Stop;

use super::StudentT;
use super::latent::{Latent, Noise};
use crate::discrepancies::common::{
    By, Groups, PerGroup, Quantity, Replicates, Setting, Unknown, start, values,
};

/// Student's t likelihood (see the module).
pub(super) struct StudentLikelihood {
    setting: Setting,
    hyper: Vec<Hyperparameter>,
    groups: Groups,
    scale: PerGroup,
    freedom: PerGroup,
    latent: Option<Latent>,
    replicates: Replicates,
    /// Measured outputs with all their values.
    outputs: Vec<(usize, Vec<f64>)>,
}

/// Mean of each output, scale of each group, and degrees of freedom.
struct At<'a> {
    mean: Vec<f64>,
    scale: &'a [f64],
    freedom: f64,
}

impl StudentLikelihood {
    pub(super) fn new(options: &StudentT, known: &Known<'_>) -> Result<Self, Stop> {
        Self::of_part(options, known, known.data)
    }

    /// Builds the likelihood of a part of the data, with the directions of the common errors chosen for all data.
    pub(super) fn of_part(
        options: &StudentT,
        known: &Known<'_>,
        part: &Measurements,
    ) -> Result<Self, Stop> {
        let replicates = Replicates::of(known.data, known.common)?;
        let layout = &known.data.layout;
        let groups =
            Groups::of(layout, &options.by).map_err(Stop::new)?.with_data(&replicates.measured);
        let mut hyper = Vec::new();
        let unit = vec![1.0; layout.len()];
        let name = Unknown { name: "scale", unit: layout.unit.difference() };
        let begin = |g: usize| start(&groups, &replicates, &unit, g).sqrt();
        let scale = PerGroup::new(&options.scale, &groups, &name, begin, &mut hyper);
        let one = Groups::of(layout, &By::default()).map_err(Stop::new)?;
        let name = Unknown { name: "degrees_of_freedom", unit: Unit::dimensionless() };
        let freedom = PerGroup::new(&options.degrees_of_freedom, &one, &name, |_| 5.0, &mut hyper);
        let starts: Vec<f64> = hyper.iter().map(|h| h.start).collect();
        let degrees = freedom.values(&starts).map_or(f64::NAN, |f| f[0]);
        let noise = Noise {
            variance: of_the_mean(&replicates, &groups, scale.values(&starts), degrees),
            sizes: sizes(&options.scale, &replicates).to_vec(),
        };
        let latent = Latent::new(known, &replicates, &noise, options.common, &mut hyper)?;
        let outputs = replicates.measured.iter().map(|&i| (i, part.values(i))).collect();
        let known = Known { data: part, ..*known };
        let setting = Setting::new(&known, &replicates, &groups);
        Ok(Self { setting, hyper, groups, scale, freedom, latent, replicates, outputs })
    }

    /// Evaluates mean, scales and degrees of freedom; `None` if a scale is not above zero or the variance is
    /// infinite.
    fn at<'a>(&'a self, response: &[f64], hyper: &'a [f64]) -> Option<At<'a>> {
        let freedom = self.freedom.values(hyper)?[0];
        let scale = self.scale.values(hyper)?;
        if freedom <= 2.0 || hyper.iter().any(|h| h.is_nan()) {
            return None;
        }
        Some(At { mean: self.mean(response, hyper), scale, freedom })
    }

    /// Returns the response plus the common errors.
    pub(super) fn mean(&self, response: &[f64], hyper: &[f64]) -> Vec<f64> {
        let mut mean = response.to_vec();
        if let Some(latent) = &self.latent {
            mean.iter_mut().zip(latent.error(hyper)).for_each(|(m, e)| *m += e);
        }
        mean
    }

    fn scale_of(&self, output: usize, at: &At<'_>) -> f64 {
        self.groups.of[output].map_or(f64::NAN, |g| at.scale[g])
    }

    /// Returns the variance of each output without the common errors.
    fn variance(&self, hyper: &[f64]) -> Option<Vec<f64>> {
        let freedom = self.freedom.values(hyper)?[0];
        let squares: Vec<f64> = self.scale.values(hyper)?.iter().map(|s| s * s).collect();
        let factor = freedom / (freedom - 2.0);
        Some(self.groups.spread(&squares).iter().map(|s| factor * s).collect())
    }
}

/// Returns the variance of an efficient estimate of the centre at each measured output: `(d + 3) / (d + 1) s^2 / n`,
/// from the Fisher information of Student's t distribution (Lange, Little and Taylor 1989, appendix B).
fn of_the_mean(
    replicates: &Replicates,
    groups: &Groups,
    scale: Option<&[f64]>,
    freedom: f64,
) -> Vec<f64> {
    let factor = (freedom + 3.0) / (freedom + 1.0);
    let one = |(k, &i): (usize, &usize)| {
        let scale = groups.of[i].and_then(|g| scale.map(|s| s[g])).unwrap_or(f64::NAN);
        factor * scale * scale / replicates.count[k]
    };
    replicates.measured.iter().enumerate().map(one).collect()
}

/// Returns the ratios of the actual scale to its initial value that must be expected: 1 if it is known, a narrow
/// range if replicates show it, and a wide one for single values.
fn sizes(scale: &Quantity, replicates: &Replicates) -> &'static [f64] {
    match scale {
        Quantity::Known(_) => &[1.0],
        Quantity::Unknown(_) if replicates.count.iter().any(|&n| n > 1.0) => &[0.5, 1.0, 2.0],
        Quantity::Unknown(_) => &[0.1, 0.3, 1.0, 3.0, 10.0],
    }
}

/// Returns the log density at the centre, for scale 1.
fn log_height(freedom: f64) -> f64 {
    ln_gamma(0.5 * (freedom + 1.0)) - ln_gamma(0.5 * freedom) - 0.5 * (freedom * PI).ln()
}

/// Returns `sum log(1 + (y - m)^2 / w)`, with one logarithm for as many factors as cannot overflow.
fn log_factors(values: &[f64], mean: f64, w: f64) -> f64 {
    let (mut sum, mut product) = (0.0, 1.0_f64);
    for y in values {
        let factor = 1.0 + (y - mean) * (y - mean) / w;
        product *= factor;
        if product > 1e150 {
            sum += if product.is_finite() {
                product.ln()
            } else {
                (product / factor).ln() + factor.ln()
            };
            product = 1.0;
        }
    }
    sum + product.ln()
}

/// Returns the derivative of `ln_gamma` (Abramowitz and Stegun 6.3.5 and 6.3.18).
fn digamma(x: f64) -> f64 {
    let (mut x, mut sum) = (x, 0.0);
    while x < 10.0 {
        sum -= 1.0 / x;
        x += 1.0;
    }
    let m = 1.0 / (x * x);
    let series =
        m * (1.0 / 12.0 - m * (1.0 / 120.0 - m * (1.0 / 252.0 - m * (1.0 / 240.0 - m / 132.0))));
    sum + x.ln() - 0.5 / x - series
}

impl Likelihood for StudentLikelihood {
    fn hyperparameters(&self) -> &[Hyperparameter] {
        &self.hyper
    }

    fn log_likelihood(&self, response: &[f64], hyper: &[f64]) -> f64 {
        let Some(at) = self.at(response, hyper) else { return f64::NEG_INFINITY };
        let height = log_height(at.freedom);
        let of = |(i, values): &(usize, Vec<f64>)| {
            let s = self.scale_of(*i, &at);
            let factors = log_factors(values, at.mean[*i], at.freedom * s * s);
            values.len() as f64 * (height - s.ln()) - 0.5 * (at.freedom + 1.0) * factors
        };
        let value: f64 = self.outputs.iter().map(of).sum();
        if value.is_nan() { f64::NEG_INFINITY } else { value }
    }

    fn is_cheap(&self) -> bool {
        true
    }

    fn gradient(&self, response: &[f64], hyper: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let (mut by_mean, mut by_hyper) = (vec![0.0; response.len()], vec![0.0; hyper.len()]);
        let Some(at) = self.at(response, hyper) else { return (by_mean, by_hyper) };
        let f = at.freedom;
        let (mut by_scale, mut by_freedom) = (vec![0.0; at.scale.len()], 0.0);
        let height = 0.5 * (digamma(0.5 * (f + 1.0)) - digamma(0.5 * f) - 1.0 / f);
        for (i, values) in &self.outputs {
            let Some(g) = self.groups.of[*i] else { continue };
            let s = at.scale[g];
            for y in values {
                let d = y - at.mean[*i];
                let w = f * s * s + d * d;
                by_mean[*i] += (f + 1.0) * d / w;
                by_scale[g] += ((f + 1.0) * d * d / w - 1.0) / s;
                let q = d * d / (f * s * s);
                by_freedom += height - 0.5 * q.ln_1p() + 0.5 * (f + 1.0) * d * d / (f * w);
            }
        }
        self.scale.add_gradient(&by_scale, &mut by_hyper);
        self.freedom.add_gradient(&[by_freedom], &mut by_hyper);
        if let Some(latent) = &self.latent {
            latent.add_gradient(&by_mean, &mut by_hyper);
        }
        (by_mean, by_hyper)
    }

    /// Given the weights of the common errors the values are independent.
    fn left_out(&self, response: &[f64], hyper: &[f64]) -> Option<Vec<f64>> {
        let at = self.at(response, hyper)?;
        let height = log_height(at.freedom);
        let one = |(i, y): (usize, f64)| {
            let s = self.scale_of(i, &at);
            let z = (y - at.mean[i]) / s;
            height - s.ln() - 0.5 * (at.freedom + 1.0) * (z * z / at.freedom).ln_1p()
        };
        Some(values(&self.setting.data).map(one).collect())
    }

    /// The common errors contribute the square of the sampled part, and the variance of the rest.
    fn predictive(&self, _response: &[f64], hyper: &[f64]) -> Vec<VariancePart> {
        let mut parts = self.setting.own_parts(&self.variance(hyper).unwrap_or_default());
        if let Some(latent) = &self.latent {
            parts.extend(latent.predictive(hyper));
        }
        parts
    }

    /// The parts of the noise share the divisor of Student's t distribution, so that their sum has that distribution.
    fn errors(&self, _: &[f64], hyper: &[f64], stream: &Stream) -> Vec<ErrorPath> {
        let freedom = self.freedom.values(hyper).map_or(f64::NAN, |f| f[0]);
        let law = Distribution::Gamma([0.5 * freedom, 2.0 / freedom]);
        let mut rng = stream.named("divisor").generator();
        // The variance of such a number is larger by `freedom / (freedom - 2)` than the square of its scale.
        let factor = ((freedom - 2.0) / freedom).sqrt();
        let divided: Vec<f64> = (0..self.setting.data.layout.len())
            .map(|_| factor / law.sample(&mut rng).sqrt())
            .collect();
        let draw = |part: &VariancePart, stream: &Stream| {
            let mut path = part.independent(stream);
            path.values.iter_mut().zip(&divided).for_each(|(z, d)| *z *= d);
            path
        };
        let variance = self.variance(hyper).unwrap_or_default();
        let own = self.setting.own_errors(&variance, stream, draw);
        let common = self.latent.iter().flat_map(|l| l.errors(hyper, &stream.named("common")));
        own.into_iter().chain(common).collect()
    }

    /// A Student's t number is a normal number divided by the root of a chi-squared number over its degrees of
    /// freedom.
    fn simulate(&self, response: &[f64], hyper: &[f64], stream: &Stream) -> Vec<Measurements> {
        let mut mean = self.mean(response, hyper);
        if let Some(latent) = &self.latent {
            let rest = latent.rest(&stream.named("common"));
            mean.iter_mut().zip(rest).for_each(|(m, e)| *m += e);
        }
        let freedom = self.freedom.values(hyper).map_or(f64::NAN, |f| f[0]);
        let scale = self.groups.spread(self.scale.values(hyper).unwrap_or_default());
        let law = Distribution::Gamma([0.5 * freedom, 2.0 / freedom]);
        vec![self.setting.replaced(stream, |own| {
            let mut rng = own.generator();
            let mut value = |(m, s): (&f64, &f64)| {
                let z = normal(&mut rng);
                m + s * z / law.sample(&mut rng).sqrt()
            };
            mean.iter().zip(&scale).map(&mut value).collect()
        })]
    }

    fn sampled_errors(&self, hyper: &[f64]) -> Option<SampledErrors> {
        let latent = self.latent.as_ref()?;
        let freedom = self.freedom.values(hyper)?;
        let mean =
            of_the_mean(&self.replicates, &self.groups, self.scale.values(hyper), freedom[0]);
        let mut noise = vec![f64::INFINITY; self.setting.data.layout.len()];
        for (&i, variance) in self.replicates.measured.iter().zip(mean) {
            noise[i] = variance;
        }
        Some(SampledErrors { noise, sampled: latent.sampled(), left_out: latent.left_out() })
    }

    fn facts(&self) -> Vec<Fact> {
        let count: usize = self.outputs.iter().map(|(_, values)| values.len()).sum();
        let mut facts =
            vec![Fact::new("data", count), Fact::new("measured outputs", self.outputs.len())];
        facts.extend(self.latent.iter().map(|l| {
            let (kept, share) = (l.count(), 100.0 * l.share);
            Fact::new(
                "directions of the common errors",
                format!("{kept}, with {share:.1} % of their variance"),
            )
        }));
        facts
    }
}
