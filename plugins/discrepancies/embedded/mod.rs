//! `embedded`: model error as scatter of the parameters inside the model.

mod bias;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;

use lacuna::data::{Layout, Measurements};
use lacuna::plugin::component::{Component, Context};
use lacuna::plugin::discrepancy::{Discrepancy, Known, Likelihood, StatedNoise};
use lacuna::run::Stop;
use lacuna::text::problem::Complaints;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::common::{
    Biased, By, Dense, Groups, Noise, PerGroup, Quantity, Replicates, Unknown, Variance,
};
use bias::{Direction, EmbeddedBias};

/// Model error inside the model: chosen parameters are random variables, plus independent normal noise.
///
/// The model error is described by parameters `θ + δ ξ` with `ξ` standard normal: no single value fits all data, and the
/// spread `δ` is what values would be needed (Sargsyan, Najm and Ghanem, Int. J. Chemical Kinetics 47 (2015) 246;
/// Sargsyan, Huan and Najm, Int. J. Uncertainty Quantification 9 (2019) 365). In contrast to a bias that is added to the
/// response, it follows the model to other quantities and other conditions: every prediction has the variance
///
/// ```text
/// Σ_j (δ_j ∂f/∂θ_j)²
/// ```
///
/// to first order. The derivatives are those at the best fit of the data, for all outputs and scenarios, measured or not;
/// if the response is not linear over the spread, the variance is that of its tangent.
///
/// With `likelihood = "independent"` the errors of the data are independent of each other with these variances (the
/// independent normal likelihood of the reference): `δ` becomes the size of the residuals that the model leaves. With
/// `"joint"` they have their full covariance, of a rank that is the number of parameters with a spread: exact if the
/// replicates are of one object with other values of the parameters, but residuals of another shape count as noise.
/// Predictions are correlated in both.
///
/// The variance of a new replicate is reported as `measurement` (the noise), `model_form` (that of the parameters'
/// spread), and the common errors. The covariance is dense: the cost of an evaluation grows with the cube of the number
/// of measured outputs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Embedded {
    /// Spread `δ` of parameters, in the unit of each: a prior such as `stiffness = { half_normal = 5 }`, or
    /// `{ known = 5 }`. Unknown ones are named `spread[stiffness]`.
    pub spread: BTreeMap<String, Quantity>,
    /// Distribution of the data's errors that follow from the spread.
    #[serde(default)]
    pub likelihood: Dependence,
    /// Variance of the noise, in the squared unit of the response: a prior such as `{ half_normal = 1e-6 }`,
    /// `{ known = 2.5e-11 }`, or a multiple of the measured variance, `{ measured = { known = 1 } }`, as for
    /// `gaussian`.
    pub variance: Variance,
    /// Groups of outputs with a common variance of the noise: `"all"`, one per value of an axis such as `"sensor"`,
    /// windows of an axis, or a list of these.
    #[serde(default)]
    pub by: By,
}

/// Dependence of the errors that follow from the spread of parameters.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Dependence {
    /// Independent values with the variances of the spread.
    #[default]
    Independent,
    /// The covariance of the spread: one value of the parameters for all data.
    Joint,
}

impl Component for Embedded {
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        let layout = context.layout;
        self.by.check("by", layout, complaints);
        self.variance.check(Groups::of(layout, &self.by).ok().as_ref(), complaints);
        if self.spread.is_empty() {
            complaints
                .at("spread")
                .say("no parameter has a spread")
                .expected("a parameter with a prior, such as `stiffness = { half_normal = 5 }`");
        }
        let names: Vec<String> =
            context.parameters.iter().map(|p| format!("`{}`", p.name)).collect();
        for (name, spread) in &self.spread {
            let at = format!("spread.{name}");
            if context.parameters.iter().all(|p| p.name != *name) {
                complaints
                    .at(&at)
                    .say("the study has no such parameter")
                    .expected(names.join(", "))
                    .found(format!("`{name}`"));
            }
            spread.check_positive(&at, 1, complaints);
        }
    }
}

impl Embedded {
    /// Builds the likelihood of `known.data`, with measured variances taken from the replicates of `shown`.
    fn under(&self, known: &Known<'_>, shown: &Measurements) -> Result<Biased<EmbeddedBias>, Stop> {
        let replicates = Replicates::of(known.data, known.common)?;
        let layout = &known.data.layout;
        let slopes = (known.slopes)()?;
        if slopes.rows() != layout.len() || slopes.columns() != known.parameters.len() {
            return Err(Stop::new("the slopes of the model are not those of the parameters"));
        }
        let mut hyper = Vec::new();
        let mut directions = Vec::new();
        for (j, parameter) in known.parameters.iter().enumerate() {
            let Some(spread) = self.spread.get(&parameter.name) else { continue };
            let sd = parameter.scale();
            let slope = slopes.column(j).iter().map(|s| s / sd).collect();
            let name = Unknown { name: "spread", unit: parameter.unit.difference() };
            let group = Groups {
                names: vec![parameter.name.clone()],
                of: vec![Some(0); layout.len()],
                position: vec![0],
            };
            let spread = PerGroup::new(spread, &group, &name, |_| 0.1 * sd, &mut hyper);
            directions.push(Direction { slope, spread });
        }
        if directions.is_empty() {
            return Err(Stop::new("no parameter of the model has a spread"));
        }
        let noise = Noise::new(known, shown, &replicates, (&self.variance, &self.by), &mut hyper)?;
        let factor = replicates.common_factor(known.common)?;
        let bias = EmbeddedBias {
            directions,
            measured: replicates.measured.clone(),
            form: self.likelihood,
        };
        let dense = Dense::new(replicates, factor, layout.len());
        Ok(Biased { noise, hyper, dense, bias })
    }
}

impl Discrepancy for Embedded {
    fn likelihood(&self, known: &Known<'_>) -> Result<Box<dyn Likelihood>, Stop> {
        Ok(Box::new(self.under(known, known.data)?))
    }

    fn likelihood_of_part(
        &self,
        known: &Known<'_>,
        part: &Measurements,
    ) -> Result<Option<Box<dyn Likelihood>>, Stop> {
        let known_part = Known { data: part, ..*known };
        Ok(Some(Box::new(self.under(&known_part, known.data)?)))
    }

    fn stated_noise(&self, layout: &Layout, _: &[f64]) -> Option<StatedNoise> {
        let sd = self.variance.known_sd(layout, &self.by)?;
        Some(StatedNoise { sd, correlation_time: None })
    }
}

lacuna::register!(Discrepancy, "embedded", Embedded);
