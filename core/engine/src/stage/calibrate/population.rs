//! Populations in a calibration: coordinates of the members from a first look at the data, and what the draws say of members and
//! populations.

use lacuna::data::{Draws, Form};
use lacuna::math::distribution::Distribution;
use lacuna::math::moments;
use lacuna::plugin::Target;
use lacuna::run::Stop;
use lacuna_linalg::Matrix;
use lacuna_optimise::Optimum;
use serde::{Deserialize, Serialize};

use crate::posterior::{Posterior, Together};
use crate::stage::stream;
use crate::study::Study;

/// Result of a population.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PopulationOutcome {
    /// Name of the parameter.
    pub parameter: String,
    /// Form of the distribution.
    pub form: Form,
    /// Name of the mean, median or location.
    pub location: String,
    /// Name of the standard deviation or scale.
    pub scale: String,
    /// Members, in the order of the scenarios.
    pub members: Vec<MemberOutcome>,
    /// Prediction for a further member, of which nothing was measured.
    pub new_member: NewMember,
    /// Central 95 % range of the posterior of the scale relative to that of its prior.
    pub scale_range: f64,
}

/// Result of a member of a population.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MemberOutcome {
    /// Name of the parameter of the group: `sound_speed[T24]`.
    pub name: String,
    /// Partial pooling: mean over the draws of the share of the population's variance that the data leave to the member given
    /// location and scale. It is the weight of the location in the member's conditional mean: 0 if the data determine the
    /// member, 1 if they say nothing of it.
    pub pooling: f64,
    /// Degree to which its coordinate was centred, from 0 to 1.
    pub centred: f64,
    /// True if a scenario of the group was measured.
    pub measured: bool,
}

/// Distribution of the parameter of a further member, in the parameter's unit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct NewMember {
    /// Mean.
    pub mean: f64,
    /// Standard deviation.
    pub sd: f64,
    /// 2.5 % quantile.
    pub q025: f64,
    /// Median.
    pub median: f64,
    /// 97.5 % quantile.
    pub q975: f64,
}

/// Largest number of draws over which the pooling is averaged.
const DRAWS: usize = 2000;

/// The posterior in coordinates whose members are centred to the degree to which the data determine them, and its maxima in
/// place of those of the standardised members; `None` without populations.
pub(super) fn adapted<'a>(
    posterior: &Posterior<'a>,
    maxima: &mut Vec<Optimum>,
) -> Result<Option<Posterior<'a>>, Stop> {
    if posterior.populations().is_empty() {
        return Ok(None);
    }
    // The standardised members are largest at a large scale, where each has the value of its own data.
    let information = look(posterior, &posterior.natural(&maxima[0].point)).1;
    let marginal = posterior.with_centred(&posterior.centred(), &information);
    let starts = Matrix::from_rows(
        posterior.dimension(),
        maxima.iter().map(|maximum| maximum.point.as_slice()),
    );
    *maxima = lacuna_optimise::maximise(&marginal.mode(), &starts);
    let Some(best) = maxima.first() else {
        return Err(Stop::new("no maximum of the posterior density was found"));
    };
    let centred = look(&marginal, &marginal.natural(&best.point)).0;
    let adapted = marginal.with_centred(&centred, &information);
    for maximum in maxima {
        maximum.point = adapted.coordinates(&marginal.natural(&maximum.point));
    }
    Ok(Some(adapted))
}

/// Degree to which the data determine each member at natural values, and the precision of what they say of it, in the order
/// of the posterior.
fn look(posterior: &Posterior<'_>, natural: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let together = posterior.information(natural);
    let members = posterior.populations().iter().flat_map(|population| {
        population.members.iter().map(move |&place| (place, natural[population.scale]))
    });
    let degree = |place: usize| {
        let pooling = pooling_of(&together, place, natural).filter(|pooling| pooling.is_finite());
        1.0 - pooling.unwrap_or(1.0).clamp(1e-12, 1.0)
    };
    members
        .map(|(place, scale)| {
            let degree = degree(place);
            (degree, degree / (1.0 - degree) / (scale * scale))
        })
        .unzip()
}

fn pooling_of(together: &[Together], place: usize, natural: &[f64]) -> Option<f64> {
    together.iter().find_map(|group| {
        let k = group.places.iter().position(|&other| other == place)?;
        Some(group.pooling(natural)[k])
    })
}

/// Results of all populations from the draws after the burn-in, in natural units.
pub(super) fn outcomes(
    study: &Study,
    posterior: &Posterior<'_>,
    draws: &Draws,
) -> Vec<PopulationOutcome> {
    if posterior.populations().is_empty() || draws.is_empty() {
        return Vec::new();
    }
    let d = draws.dimension();
    let mean: Vec<f64> = (0..d).map(|j| moments::mean(&draws.pooled(j))).collect();
    let together = posterior.information(&mean);
    let all: Vec<&[f64]> = draws.values.chunks_exact(d).collect();
    let every = all.len().div_ceil(DRAWS);
    let thinned: Vec<&[f64]> = all.iter().step_by(every).copied().collect();
    let centred = posterior.centred();
    let mut next = 0;
    let random = stream(study, "new-member");
    let mut outcomes = Vec::new();
    let priors: Vec<&Distribution> = posterior.priors().collect();
    for population in posterior.populations() {
        let member = |(k, &place): (usize, &usize)| {
            let each = thinned.iter().filter_map(|point| pooling_of(&together, place, point));
            // Unknowns besides the parameters belong to groups that were measured.
            let member = study.unknowns.get(place).and_then(|unknown| unknown.member.as_ref());
            let is_measured = |&s: &usize| !study.scenarios[s].unmeasured;
            MemberOutcome {
                name: posterior.name(place).to_owned(),
                pooling: moments::mean(&each.collect::<Vec<_>>()),
                centred: centred[next + k],
                measured: member.is_none_or(|own| own.scenarios.iter().any(is_measured)),
            }
        };
        let members: Vec<MemberOutcome> =
            population.members.iter().enumerate().map(member).collect();
        next += members.len();
        let prior = priors[population.scale];
        let scale = moments::sorted(&draws.pooled(population.scale));
        let range = moments::quantile(&scale, 0.975) - moments::quantile(&scale, 0.025);
        let stream = random.named(&population.name);
        let further = |(i, point): (usize, &&[f64])| {
            let (location, scale) = (point[population.location], point[population.scale]);
            population.sample(location, scale, &mut stream.at(i as u64).generator())
        };
        outcomes.push(PopulationOutcome {
            parameter: population.name.clone(),
            form: population.form,
            location: posterior.name(population.location).to_owned(),
            scale: posterior.name(population.scale).to_owned(),
            members,
            new_member: summary(&all.iter().enumerate().map(further).collect::<Vec<_>>()),
            scale_range: range / (prior.quantile(0.975) - prior.quantile(0.025)),
        });
    }
    outcomes
}

fn summary(values: &[f64]) -> NewMember {
    let sorted = moments::sorted(values);
    let quantile = |p: f64| moments::quantile(&sorted, p);
    NewMember {
        mean: moments::mean(values),
        sd: moments::variance(values).sqrt(),
        q025: quantile(0.025),
        median: quantile(0.5),
        q975: quantile(0.975),
    }
}
