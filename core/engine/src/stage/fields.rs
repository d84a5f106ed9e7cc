//! Random fields under the posterior: their values at their places, from the draws of their coefficients.

use lacuna::data::{Draws, Field};
use lacuna::math::moments;
use lacuna::math::random::{Stream, normal};

use crate::report::findings::{FieldBand, FieldFindings};
use crate::study::Study;

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
