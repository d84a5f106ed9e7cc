//! Random fields under the posterior: their values at their places, from the draws of their coefficients.

use lacuna::data::{Draws, Field};
use lacuna::math::moments;
use lacuna::math::random::{Stream, normal};

use crate::study::Study;

/// Random field as an input of the model.
#[derive(Debug, Clone, PartialEq)]
pub struct FieldFindings {
    /// The field.
    pub field: Field,
    /// Prior at its places.
    pub prior: FieldBand,
    /// Posterior at its places, of a study with data.
    pub posterior: Option<FieldBand>,
}

/// Distribution of a field at each of its places, in its unit.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct FieldBand {
    /// Mean.
    pub mean: Vec<f64>,
    /// Standard deviation.
    pub sd: Vec<f64>,
    /// 2.5 % quantile.
    pub q025: Vec<f64>,
    /// Median.
    pub median: Vec<f64>,
    /// 97.5 % quantile.
    pub q975: Vec<f64>,
}

impl FieldBand {
    /// Adds the next place: mean, standard deviation, and the quantiles in ascending order.
    pub fn push(&mut self, mean: f64, sd: f64, [low, middle, high]: [f64; 3]) {
        self.mean.push(mean);
        self.sd.push(sd);
        self.q025.push(low);
        self.median.push(middle);
        self.q975.push(high);
    }
}

/// Largest number of draws, equally spaced, from which a field is described.
const MOST_DRAWS: usize = 4000;

/// Standard normal quantile of 97.5 %.
const EDGE: f64 = 1.959_963_984_540_054;

/// The fields of a study, with their posterior if there are draws (those after the burn-in).
pub fn findings(study: &Study, kept: Option<&Draws>) -> Vec<FieldFindings> {
    let describe = |field: &Field| FieldFindings {
        field: field.clone(),
        prior: prior(field),
        posterior: kept.map(|draws| posterior(study, field, draws)),
    };
    study.fields.iter().map(|field| describe(field)).collect()
}

/// Distribution of the field at each place under the prior, in closed form.
fn prior(field: &Field) -> FieldBand {
    let mut band = FieldBand::default();
    let sd = field.sd;
    for level in &field.level {
        let ends = [-EDGE, 0.0, EDGE].map(|z| level + z * sd);
        let (mean, sd) = if field.log_normal {
            let mean = (level + 0.5 * sd * sd).exp();
            (mean, mean * (sd * sd).exp_m1().sqrt())
        } else {
            (*level, sd)
        };
        band.push(mean, sd, if field.log_normal { ends.map(f64::exp) } else { ends });
    }
    band
}

/// Distribution of a field at each place over the draws. The neglected terms are drawn from their prior, on which data that a
/// model with these terms explains have no influence.
fn posterior(study: &Study, field: &Field, draws: &Draws) -> FieldBand {
    let names = field.coefficients();
    let place = |name: &String| study.parameters.iter().position(|p| p.name == *name);
    let places: Vec<usize> = names.iter().filter_map(place).collect();
    let points = draws.points();
    let stride = points.rows().div_ceil(MOST_DRAWS).max(1);
    let values = |i: usize| {
        let coefficients: Vec<f64> = places.iter().map(|&j| points[(i, j)]).collect();
        field.values(&coefficients)
    };
    let fields: Vec<Vec<f64>> = (0..points.rows()).step_by(stride).map(values).collect();
    let random = Stream::root(study.about.seed).named("fields").named(&field.name);
    let mut band = FieldBand::default();
    for (i, rest) in field.neglected().into_iter().enumerate() {
        let mut rng = random.at(i as u64).generator();
        let whole = |value: f64, z: f64| {
            if field.log_normal { value * (rest * z).exp() } else { value + rest * z }
        };
        let here: Vec<f64> =
            fields.iter().map(|values| whole(values[i], normal(&mut rng))).collect();
        let sorted = moments::sorted(&here);
        let ends = [0.025, 0.5, 0.975].map(|p| moments::quantile(&sorted, p));
        band.push(moments::mean(&here), moments::variance(&here).sqrt(), ends);
    }
    band
}
