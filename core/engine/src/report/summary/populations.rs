//! The keys of populations.

use lacuna::data::Form;
use schemars::JsonSchema;
use serde::Serialize;

use super::value::{ByName, Quantity};
use crate::report::findings::CalibrationFindings;
use crate::stage::calibrate::{MemberOutcome, NewMember as Found, PopulationOutcome};

/// A population from which the values of a parameter in its groups are drawn. The posterior of the members, the location and the
/// scale is under `parameters`.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Population {
    /// Form of the distribution: `normal`, `log_normal` or `student_t`.
    pub form: String,
    /// Name of the mean, median or location among the `parameters`.
    pub location: String,
    /// Name of the standard deviation or scale among the `parameters`.
    pub scale: String,
    /// Members, by the name of their parameter.
    #[schemars(extend("propertyNames" = { "title": "member" }))]
    pub members: ByName<Member>,
    /// Prediction for a further member, of which nothing was measured.
    pub new_member: NewMember,
    /// Central 95 % range of the posterior of the scale relative to that of its prior.
    pub scale_range: Quantity,
}

/// A member of a population.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Member {
    /// Partial pooling: mean share of the population's variance that the data leave to the member given location and scale, the
    /// weight of the location in its conditional mean. 0 if the data determine the member, 1 if they say nothing of it.
    pub pooling: Quantity,
    /// Degree to which its coordinate was centred for sampling, from 0 to 1.
    pub centred: Quantity,
    /// True if a scenario of the group was measured.
    pub measured: bool,
}

/// Prediction of the parameter of a further member, in the unit of the members.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct NewMember {
    /// Mean.
    pub mean: Quantity,
    /// Standard deviation, with the scatter between members.
    pub sd: f64,
    /// 2.5 % quantile.
    pub q025: f64,
    /// Median.
    pub median: f64,
    /// 97.5 % quantile.
    pub q975: f64,
}

/// The populations of a calibration.
pub fn by_name(found: &CalibrationFindings) -> ByName<Population> {
    found.populations.iter().map(|own| (own.parameter.clone(), Population::of(own))).collect()
}

impl Population {
    fn of(found: &PopulationOutcome) -> Self {
        let form = match found.form {
            Form::Normal => "normal",
            Form::LogNormal => "log_normal",
            Form::StudentT(_) => "student_t",
        };
        let member = |own: &MemberOutcome| {
            let (pooling, centred) = (Quantity(own.pooling), Quantity(own.centred));
            (own.name.clone(), Member { pooling, centred, measured: own.measured })
        };
        let Found { mean, sd, q025, median, q975 } = found.new_member;
        Self {
            form: form.to_owned(),
            location: found.location.clone(),
            scale: found.scale.clone(),
            members: found.members.iter().map(member).collect(),
            new_member: NewMember { mean: Quantity(mean), sd, q025, median, q975 },
            scale_range: Quantity(found.scale_range),
        }
    }
}
