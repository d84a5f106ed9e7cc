//! `student_t`: differences with heavy tails.

mod latent;
mod likelihood;
#[cfg(test)]
mod tests;

use lacuna::data::{Layout, Measurements};
use lacuna::math::distribution::Distribution;
use lacuna::plugin::component::{Component, Context};
use lacuna::plugin::discrepancy::{Discrepancy, Known, Likelihood, StatedNoise};
use lacuna::run::Stop;
use lacuna::study::problem::Complaints;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::common::{By, Groups, Quantity};
use likelihood::StudentLikelihood;

/// Independent differences with heavy tails: Student's t, of one unknown scale or of one for each
/// group of outputs.
///
/// Every measured value is the model's response, plus the errors that all replicates share, plus
/// `scale` times a number with Student's t law of `degrees_of_freedom` (Lange, Little and Taylor,
/// J. American Statistical Association 84 (1989) 881). A single wild value then pulls the
/// parameters less than under the normal law, to which Student's law tends for many degrees of
/// freedom.
///
/// The errors that all replicates share stay normal. They are sampled: the standard normal weights
/// of their leading directions are unknowns of the study, called `emulator[1]`, `emulator[2]`, ….
/// That is exact for the directions that are kept; the rest, the part of their variance beyond
/// `common.share`, is left out, and the report says how much that is. All values enter one by one,
/// since Student's law has no sufficient statistics.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StudentT {
    /// The scale, in the unit of the response: a prior such as `{ half_normal = 1e-5 }`, or
    /// `{ known = 5e-6 }`. Unknown ones are called `scale`, or `scale[B]`, and are sampled as
    /// logarithms, with the Jacobian. The standard deviation is `sqrt(d / (d - 2))` times the scale
    /// for `d` degrees of freedom.
    pub scale: Quantity,
    /// Which outputs share a scale: `"all"`, an axis such as `"sensor"`, windows, or a list of these.
    #[serde(default)]
    pub by: By,
    /// The degrees of freedom: `{ known = 4 }` or a prior. The default is that of Juárez and Steel
    /// (J. Business and Economic Statistics 28 (2010) 52). Values of 2 and less, for which there is
    /// no variance, are excluded.
    #[serde(default = "degrees_of_freedom")]
    pub degrees_of_freedom: Quantity,
    /// How many directions of the errors that all replicates share are sampled.
    #[serde(default)]
    pub common: Directions,
}

/// How many directions of each common error are kept.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Directions {
    /// The share of an error's variance, in units of the noise of the mean curve, that the
    /// directions must carry.
    pub share: f64,
    /// The most directions of one error.
    pub most: usize,
}

impl Default for Directions {
    fn default() -> Self {
        Self { share: 0.99, most: 20 }
    }
}

fn degrees_of_freedom() -> Quantity {
    Quantity::Unknown(Distribution::Gamma([2.0, 10.0]))
}

impl Component for StudentT {
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        self.by.check("by", context.layout, complaints);
        let groups = Groups::of(context.layout, &self.by).map_or(1, |g| g.count());
        self.scale.check_positive("scale", groups, complaints);
        self.degrees_of_freedom.check_positive("degrees_of_freedom", 1, complaints);
        let most = match &self.degrees_of_freedom {
            Quantity::Known(values) => values.first().copied().unwrap_or(f64::NAN),
            Quantity::Unknown(prior) => prior.support().1,
        };
        if most.is_nan() || most <= 2.0 {
            complaints
                .at("degrees_of_freedom")
                .say("there is no variance for 2 degrees of freedom or less")
                .expected("a number above 2")
                .found(most);
        }
        if !(0.0..=1.0).contains(&self.common.share) {
            complaints
                .at("common.share")
                .say("a share is a number from 0 to 1")
                .found(self.common.share);
        }
    }
}

impl Discrepancy for StudentT {
    fn likelihood(&self, known: &Known<'_>) -> Result<Box<dyn Likelihood>, Stop> {
        Ok(Box::new(StudentLikelihood::new(self, known)?))
    }

    fn likelihood_of_part(
        &self,
        known: &Known<'_>,
        part: &Measurements,
    ) -> Result<Option<Box<dyn Likelihood>>, Stop> {
        Ok(Some(Box::new(StudentLikelihood::of_part(self, known, part)?)))
    }

    fn stated_noise(&self, layout: &Layout, _: &[f64]) -> Option<StatedNoise> {
        let scales = self.scale.known(layout, &self.by)?;
        let degrees = self.degrees_of_freedom.known(layout, &By::default())?;
        let sd = scales.iter().zip(degrees).map(|(s, d)| s * (d / (d - 2.0)).sqrt()).collect();
        Some(StatedNoise { sd, correlation_time: None })
    }
}

lacuna::register!(Discrepancy, "student_t", StudentT, aliases: ["t", "student"]);
