//! Independent noise with a variance for each group of outputs.

use std::sync::{Arc, OnceLock};

use lacuna::data::measurements::Summary;
use lacuna::data::{Measurements, Replicate, Unit};
use lacuna::math::distribution::Distribution;
use lacuna::math::random::{Stream, normal};
use lacuna::plugin::discrepancy::{CommonError, ErrorPath, Hyperparameter, Known, VariancePart};
use lacuna::run::Stop;

use super::{By, Groups, Normal, PerGroup, Places, Replicates, Unknown, Variance, squared};

/// The data of a study and the errors common to all replicates, from which replicates are predicted and simulated.
#[derive(Debug, Clone)]
pub struct Setting {
    /// Measurements of the study.
    pub data: Measurements,
    /// Errors common to all replicates.
    pub common: Arc<[CommonError]>,
    /// Those that a new replicate has, as parts of its variance; made when they are asked for.
    common_parts: Arc<OnceLock<Vec<VariancePart>>>,
    /// Number of values of each output.
    counts: Vec<usize>,
    /// Places of the values, made when they are asked for.
    places: OnceLock<Places>,
    /// Variance of each output stated by the data, or else the variance between replicates pooled over its group;
    /// `None` without either.
    replicated: Option<Vec<f64>>,
}

/// The noise of a study's data.
#[derive(Debug, Clone)]
pub struct Noise {
    /// The data and the common errors.
    pub setting: Setting,
    /// Groups of outputs with a common variance.
    pub groups: Groups,
    /// Variance or multiplier of each group.
    pub variance: PerGroup,
    /// Factor on the group's number for each output: the measured variance, or 1.
    pub scale: Vec<f64>,
}

impl Noise {
    /// Builds the noise of data and adds its unknown variances to the hyperparameters. Measured variances are those
    /// between the replicates of `shown`, of which the data are a part.
    pub fn new(
        known: &Known<'_>,
        shown: &Measurements,
        replicates: &Replicates,
        (variance, by): (&Variance, &By),
        hyper: &mut Vec<Hyperparameter>,
    ) -> Result<Self, Stop> {
        let layout = &known.data.layout;
        let groups = Groups::of(layout, by).map_err(Stop::new)?.with_data(&replicates.measured);
        let (quantity, scale, unknown) = match variance {
            Variance::Of(quantity) => {
                let unknown = Unknown { name: "variance", unit: squared(&layout.unit)? };
                (quantity, vec![1.0; layout.len()], unknown)
            }
            Variance::Measured(quantity) => {
                let unknown = Unknown { name: "multiplier", unit: Unit::dimensionless() };
                let scale = if known.data.states_noise() {
                    known.data.stated_sd().iter().map(|sd| sd * sd).collect()
                } else {
                    let whole = Replicates::of(shown, &[])?;
                    let all = Groups::of(layout, by).map_err(Stop::new)?.with_data(&whole.measured);
                    Pooled::of(&all, &whole).measured(&all, &whole)?
                };
                (quantity, scale, unknown)
            }
        };
        // With stated noise the multiplier starts at 1.
        let stated = known.data.states_noise();
        let start = |g: usize| if stated { 1.0 } else { start(&groups, replicates, &scale, g) };
        Ok(Self {
            variance: PerGroup::new(quantity, &groups, &unknown, start, hyper),
            setting: Setting::new(known, replicates, &groups),
            groups,
            scale,
        })
    }

    /// The noise of a part of the data in which no output is missing altogether.
    pub fn of_part(&self, part: &Measurements, replicates: &Replicates) -> Self {
        let common = Arc::clone(&self.setting.common);
        let setting = Setting::with(part, common, replicates, &self.groups);
        Self { setting, ..self.clone() }
    }

    /// The density of the data output by output; `None` if it cannot be computed.
    pub fn normal(&self) -> Option<Normal> {
        let Setting { data, common, .. } = &self.setting;
        Normal::new(&Replicates::of(data, common).ok()?, common).ok()
    }

    /// Returns the variance of each output, given those of the groups.
    pub fn by_output(&self, groups: &[f64]) -> Vec<f64> {
        self.groups.spread(groups).iter().zip(&self.scale).map(|(v, s)| v * s).collect()
    }

    /// Returns the variance of each measured output, given those of the groups.
    pub fn by_measured(&self, replicates: &Replicates, groups: &[f64]) -> Vec<f64> {
        let of = |&i: &usize| self.groups.of[i].map_or(f64::NAN, |g| groups[g] * self.scale[i]);
        replicates.measured.iter().map(of).collect()
    }

    /// Returns the derivatives with respect to the groups' variances, given those with respect to the variances of
    /// the measured outputs.
    pub fn by_group(&self, replicates: &Replicates, by_measured: &[f64]) -> Vec<f64> {
        let scaled = replicates.measured.iter().zip(by_measured).map(|(&i, g)| g * self.scale[i]);
        self.groups.sums(&replicates.measured, scaled)
    }
}

impl Setting {
    /// Builds the setting; variances between replicates are pooled over these groups.
    pub fn new(known: &Known<'_>, replicates: &Replicates, groups: &Groups) -> Self {
        Self::with(known.data, known.common.into(), replicates, groups)
    }

    fn with(
        data: &Measurements,
        common: Arc<[CommonError]>,
        replicates: &Replicates,
        groups: &Groups,
    ) -> Self {
        let replicated = if data.states_noise() {
            Some(data.stated_sd().iter().map(|sd| sd * sd).collect())
        } else {
            Pooled::of(groups, replicates).by_output(groups)
        };
        let mut counts = vec![0; data.layout.len()];
        for (&i, count) in replicates.measured.iter().zip(&replicates.count) {
            counts[i] = *count as usize;
        }
        let (common_parts, places) = (Arc::default(), OnceLock::new());
        Self { data: data.clone(), common, common_parts, counts, places, replicated }
    }

    /// Splits the variance of a new replicate into parts: `measurement`, up to the variance that replicates show;
    /// `model_form`, the rest; and the common errors that a new replicate has too. Without replicates the first two
    /// are one part, `discrepancy`.
    pub fn parts(&self, variance: &[f64]) -> Vec<VariancePart> {
        let mut parts = self.own_parts(variance);
        parts.extend(self.common_parts());
        parts
    }

    /// Returns the parts without the common errors.
    pub fn own_parts(&self, variance: &[f64]) -> Vec<VariancePart> {
        let Some(replicated) = &self.replicated else {
            return vec![part("discrepancy", variance.to_vec())];
        };
        let shown: Vec<f64> = variance.iter().zip(replicated).map(|(v, r)| v.min(*r)).collect();
        let rest = variance.iter().zip(&shown).map(|(v, s)| v - s).collect();
        vec![part("measurement", shown), part("model_form", rest)]
    }

    /// Returns the parts that are common errors of a new replicate.
    pub fn common_parts(&self) -> Vec<VariancePart> {
        let all =
            || self.common.iter().filter(|error| error.predictive).map(CommonError::part).collect();
        self.common_parts.get_or_init(all).clone()
    }

    /// Returns one draw of the errors of a new replicate whose noise is independent and normal with these variances.
    pub fn errors(&self, variance: &[f64], stream: &Stream) -> Vec<ErrorPath> {
        self.errors_by(variance, stream, VariancePart::independent)
    }

    /// Like [`Setting::errors`], with the noise of each part drawn by `draw`.
    pub fn errors_by(
        &self,
        variance: &[f64],
        stream: &Stream,
        draw: impl Fn(&VariancePart, &Stream) -> ErrorPath,
    ) -> Vec<ErrorPath> {
        let own = self.own_errors(variance, stream, draw);
        own.into_iter().chain(self.drawn_common_errors(stream)).collect()
    }

    /// Returns one draw of the noise, part by part.
    pub fn own_errors(
        &self,
        variance: &[f64],
        stream: &Stream,
        draw: impl Fn(&VariancePart, &Stream) -> ErrorPath,
    ) -> Vec<ErrorPath> {
        let one = |(k, part): (usize, &VariancePart)| draw(part, &stream.at(k as u64));
        self.own_parts(variance).iter().enumerate().map(one).collect()
    }

    /// Returns one draw of each common error of a new replicate.
    pub fn drawn_common_errors(&self, stream: &Stream) -> impl Iterator<Item = ErrorPath> {
        let stream = stream.named("common");
        let all = self.common.iter().filter(|error| error.predictive).enumerate();
        all.map(move |(k, error)| error.draw(&stream.at(k as u64)))
    }

    /// Adds randomly drawn common errors to a response.
    pub fn with_common_errors(&self, response: &[f64], stream: &Stream) -> Vec<f64> {
        CommonError::added(&self.common, response, stream)
    }

    /// Returns the data with the measured values of each replicate replaced by those that `values` makes from the
    /// replicate's stream.
    pub fn replaced(&self, stream: &Stream, values: impl Fn(&Stream) -> Vec<f64>) -> Measurements {
        let one = |(r, replicate): (usize, &Replicate)| {
            let new = values(&stream.named("replicate").at(r as u64));
            let measured = replicate.values.iter().zip(new);
            let values = measured.map(|(value, new)| value.map(|_| new)).collect();
            Replicate { values, ..replicate.clone() }
        };
        self.data.with_replicates(self.data.replicates.iter().enumerate().map(one).collect())
    }

    /// Returns data with independent normal noise of these variances about a mean curve.
    pub fn noisy(&self, mean: &[f64], variance: &[f64], stream: &Stream) -> Measurements {
        let sd: Vec<f64> = variance.iter().map(|v| v.sqrt()).collect();
        self.replaced(stream, |own| {
            let mut rng = own.generator();
            mean.iter().zip(&sd).map(|(m, sd)| m + sd * normal(&mut rng)).collect()
        })
    }

    /// Outputs and values of the data with these indices, which increase.
    pub fn values_at(&self, indices: &[usize]) -> Vec<(usize, f64)> {
        let places = self.places.get_or_init(|| Places::of(&self.data));
        places.values(&self.data, indices)
    }

    /// Like [`Setting::noisy`], about a response with randomly drawn common errors.
    pub fn simulate(&self, response: &[f64], variance: &[f64], stream: &Stream) -> Measurements {
        self.noisy(&self.with_common_errors(response, stream), variance, stream)
    }

    /// Count, mean and scatter of each output of such data: the mean is normal, and the scatter has the law of a variance
    /// times a chi-square; they are independent. `None` if the data state their noise.
    pub fn simulate_summaries(
        &self,
        response: &[f64],
        variance: &[f64],
        stream: &Stream,
    ) -> Option<Vec<Summary>> {
        if self.data.states_noise() {
            return None;
        }
        let mean = self.with_common_errors(response, stream);
        let mut rng = stream.named("summaries").generator();
        let mut one = |i: usize| {
            let (count, v) = (self.counts[i], variance[i]);
            if count == 0 {
                return Summary::default();
            }
            let n = count as f64;
            let mean = mean[i] + (v / n).sqrt() * normal(&mut rng);
            let chi_square = |shape: f64| Distribution::Gamma([shape, 2.0]);
            let freedom = 0.5 * (n - 1.0);
            let scatter = if count > 1 { v * chi_square(freedom).sample(&mut rng) } else { 0.0 };
            Summary { count, mean, scatter, stated: None }
        };
        Some((0..self.counts.len()).map(&mut one).collect())
    }
}

/// Builds one part of a variance.
pub fn part(origin: &str, variance: Vec<f64>) -> VariancePart {
    VariancePart { origin: origin.into(), variance }
}

/// Returns the initial value of a group's variance: the variance of the replicates about their means, or a hundredth
/// of the mean square if there are no replicates.
pub fn start(groups: &Groups, replicates: &Replicates, scale: &[f64], group: usize) -> f64 {
    let (mut scatter, mut freedom, mut square, mut outputs) = (0.0, 0.0, 0.0, 0.0);
    for (k, &i) in replicates.measured.iter().enumerate() {
        if groups.of[i] == Some(group) {
            scatter += replicates.scatter[k] / scale[i];
            freedom += replicates.count[k] - 1.0;
            square += replicates.count[k] * replicates.mean[k].powi(2) / scale[i];
            outputs += 1.0;
        }
    }
    if freedom > 0.0 && scatter > 0.0 { scatter / freedom } else { 0.01 * square / outputs }
}

/// Scatter and degrees of freedom between replicates, per group.
struct Pooled {
    scatter: Vec<f64>,
    freedom: Vec<f64>,
}

impl Pooled {
    fn of(groups: &Groups, replicates: &Replicates) -> Self {
        Self {
            scatter: groups.sums(&replicates.measured, replicates.scatter.iter().copied()),
            freedom: groups.sums(&replicates.measured, replicates.count.iter().map(|n| n - 1.0)),
        }
    }

    /// Returns the variance of each group; the overall variance for a group without replicates; `None` if no group
    /// has any.
    fn variances(&self) -> Option<Vec<f64>> {
        let freedom: f64 = self.freedom.iter().sum();
        let overall = self.scatter.iter().sum::<f64>() / freedom;
        let one = |(s, f): (&f64, &f64)| if *f > 0.0 { s / f } else { overall };
        (freedom > 0.0).then(|| self.scatter.iter().zip(&self.freedom).map(one).collect())
    }

    fn by_output(&self, groups: &Groups) -> Option<Vec<f64>> {
        Some(groups.spread(&self.variances()?))
    }

    /// Returns the variance between the replicates of each output; that of its group if the output has fewer than two
    /// replicates or equal ones. Fails if no output has two different replicates.
    fn measured(&self, groups: &Groups, replicates: &Replicates) -> Result<Vec<f64>, Stop> {
        let refuse = || {
            Stop::new("`measured` needs an output with two different replicates, and there is none")
                .help("give the variance itself, such as `variance = { half_normal = 1e-6 }`")
        };
        let variances = self.variances().ok_or_else(refuse)?;
        let overall = self.scatter.iter().sum::<f64>() / self.freedom.iter().sum::<f64>();
        if overall <= 0.0 {
            return Err(refuse());
        }
        let positive: Vec<f64> =
            variances.iter().map(|&v| if v > 0.0 { v } else { overall }).collect();
        let mut measured = groups.spread(&positive);
        for (k, &i) in replicates.measured.iter().enumerate() {
            if replicates.count[k] > 1.0 && replicates.scatter[k] > 0.0 {
                measured[i] = replicates.scatter[k] / (replicates.count[k] - 1.0);
            }
        }
        Ok(measured)
    }
}
