//! The keys of a parameter by group.

use lacuna::data::Form;
use lacuna::math::distribution::Distribution;
use lacuna::math::random::{Stream, normal};
use lacuna::text::values::Positive;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Number of draws from which the distribution of a member by itself is described.
const DRAWS: usize = 20_000;

/// Distribution from which the values of a parameter in its groups are drawn. Its own unknowns have priors and are estimated
/// with the rest; they are called `name.mean` and `name.sd`, or as the keys here.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PopulationKeys {
    /// Normal: `{ normal = { mean = { uniform = [1300, 1500] }, sd = { half_normal = 15 } } }`.
    Normal {
        /// Prior of the mean, in the unit of the parameter.
        mean: Distribution,
        /// Prior of the standard deviation between groups, in the unit of the parameter. Choose a proper one: few groups say
        /// little about it.
        sd: Distribution,
    },
    /// The logarithm is normal, for values above zero: `{ log_normal = { median = { uniform = [1, 9] }, sd = { half_normal = 0.1 } } }`.
    LogNormal {
        /// Prior of the median, in the unit of the parameter.
        median: Distribution,
        /// Prior of the standard deviation of the natural logarithm: a relative scatter, 0.01 for 1 %.
        sd: Distribution,
    },
    /// Student's t, for populations with single groups far from the others.
    StudentT {
        /// Degrees of freedom, a known number. With 4 a group far from the others is pulled little.
        degrees_of_freedom: Positive,
        /// Prior of the location, in the unit of the parameter.
        location: Distribution,
        /// Prior of the scale, in the unit of the parameter.
        scale: Distribution,
    },
}

impl PopulationKeys {
    /// Form of the distribution.
    pub fn form(&self) -> Form {
        match self {
            Self::Normal { .. } => Form::Normal,
            Self::LogNormal { .. } => Form::LogNormal,
            Self::StudentT { degrees_of_freedom, .. } => Form::StudentT(degrees_of_freedom.get()),
        }
    }

    /// Name of the distribution as a study writes it.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Normal { .. } => "normal",
            Self::LogNormal { .. } => "log_normal",
            Self::StudentT { .. } => "student_t",
        }
    }

    /// Names and priors of location and scale.
    pub fn unknowns(&self) -> [(&'static str, &Distribution); 2] {
        match self {
            Self::Normal { mean, sd } => [("mean", mean), ("sd", sd)],
            Self::LogNormal { median, sd } => [("median", median), ("sd", sd)],
            Self::StudentT { location, scale, .. } => [("location", location), ("scale", scale)],
        }
    }

    /// The distribution of a member by itself: that of the population over the priors of its unknowns, by quantiles of draws. It
    /// describes the member in tables and figures; the posterior uses the joint density.
    pub fn marginal(&self) -> Distribution {
        let form = self.form();
        let [(_, location), (_, scale)] = self.unknowns();
        let stream = Stream::root(0).named("population");
        let draw = |i: usize| {
            let mut rng = stream.at(i as u64).generator();
            let (m, s) = (location.sample(&mut rng), scale.sample(&mut rng));
            let z = match form {
                Form::StudentT(dof) => Distribution::StudentT([dof, 0.0, 1.0]).sample(&mut rng),
                Form::Normal | Form::LogNormal => normal(&mut rng),
            };
            if form == Form::LogNormal { m * (s * z).exp() } else { m + s * z }
        };
        let draws: Vec<f64> = (0..DRAWS).map(draw).collect();
        let low = if form == Form::LogNormal { 0.0 } else { f64::NEG_INFINITY };
        let law = Distribution::of_draws(&draws, (low, f64::INFINITY), DRAWS as f64);
        law.unwrap_or_else(|| location.clone())
    }
}

/// How the values of an unknown of a discrepancy or an effect scatter between groups. The unknown's own prior is that of the mean,
/// median or location; the scatter is estimated too. They are called `variance.median` and `variance.sd`, or as the keys in the
/// `population` of a parameter.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ScatterKeys {
    /// Normal, for unknowns of either sign: `{ normal = { sd = { half_normal = 15 } } }`.
    Normal {
        /// Prior of the standard deviation between groups, in the unit of the unknown. Choose a proper one: few groups say
        /// little about it.
        sd: Distribution,
    },
    /// The logarithm is normal, for unknowns above zero: `{ log_normal = { sd = { half_normal = 0.5 } } }`.
    LogNormal {
        /// Prior of the standard deviation of the natural logarithm: a relative scatter, 0.01 for 1 %.
        sd: Distribution,
    },
    /// Student's t, for single groups far from the others.
    StudentT {
        /// Degrees of freedom, a known number. With 4 a group far from the others is pulled little.
        degrees_of_freedom: Positive,
        /// Prior of the scale, in the unit of the unknown.
        scale: Distribution,
    },
}

impl ScatterKeys {
    /// The population whose location has this prior.
    pub fn around(&self, location: &Distribution) -> PopulationKeys {
        let location = location.clone();
        match self.clone() {
            Self::Normal { sd } => PopulationKeys::Normal { mean: location, sd },
            Self::LogNormal { sd } => PopulationKeys::LogNormal { median: location, sd },
            Self::StudentT { degrees_of_freedom, scale } => {
                PopulationKeys::StudentT { degrees_of_freedom, location, scale }
            }
        }
    }

    /// Name of the key and prior of the scatter.
    pub fn scale(&self) -> (&'static str, &Distribution) {
        match self {
            Self::Normal { sd } | Self::LogNormal { sd } => ("sd", sd),
            Self::StudentT { scale, .. } => ("scale", scale),
        }
    }

    /// Name of the distribution as a study writes it.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Normal { .. } => "normal",
            Self::LogNormal { .. } => "log_normal",
            Self::StudentT { .. } => "student_t",
        }
    }
}

/// Coordinates in which the values of the groups are sampled. The posterior is the same in all of them; how well it can be
/// sampled is not.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum CoordinatesKey {
    /// Between the two others, for each group by what its data say at the posterior maximum.
    #[default]
    Auto,
    /// The values themselves: for groups with many data.
    Centred,
    /// Distances from the population's location in units of its scale: for groups with few data.
    NonCentred,
}

impl CoordinatesKey {
    /// Degree to which the coordinates are centred; `None` if the data decide.
    pub fn centred(self) -> Option<f64> {
        match self {
            Self::Auto => None,
            Self::Centred => Some(1.0),
            Self::NonCentred => Some(0.0),
        }
    }

    /// True for the default.
    #[allow(clippy::trivially_copy_pass_by_ref)] // Serde passes a reference.
    pub fn is_auto(&self) -> bool {
        *self == Self::Auto
    }
}
