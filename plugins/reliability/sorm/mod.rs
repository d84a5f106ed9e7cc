//! `sorm`: the second-order reliability method.

mod curvature;
mod formulas;

use lacuna::math::random::Stream;
use lacuna::math::special::normal_cdf;
use lacuna::plugin::reliability::{DesignPoint, Estimate, LimitState};
use lacuna::plugin::{Component, Context, Reliability};
use lacuna::run::{Progress, Stop};
use lacuna::text::Complaints;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::common::{Counted, positive, standard_normal};
use super::form::{Form, approximation, union};

/// Second-order reliability method: the limit state is replaced by paraboloids at the design points of `form`.
///
/// The principal curvatures follow from second differences in the tangent plane, at the cost of `d (d - 1)` calls per design
/// point for `d` parameters. With several design points their probabilities are added, and reduced by the overlap of
/// the half-spaces. Like `form` it knows no error of its own, and needs independent priors, not a posterior.
///
/// References: Breitung, J. Eng. Mech. 110 (1984) 357; Hohenbichler and Rackwitz, J. Eng. Mech. 114 (1988) 2195; Tvedt,
/// Structural Safety 7 (1990) 147.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Sorm {
    /// Search for the design points.
    pub form: Form,
    /// Formula for the probability beyond a paraboloid.
    pub formula: Formula,
    /// Step of the second differences, in standard deviations.
    pub step: f64,
}

/// Formula for the probability beyond a paraboloid.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Formula {
    /// Breitung's, exact in the limit of a distant design point.
    Breitung,
    /// That of Hohenbichler and Rackwitz, with a factor `phi(beta) / Phi(-beta)` in place of `beta`.
    #[default]
    HohenbichlerRackwitz,
    /// Tvedt's, of three terms.
    Tvedt,
}

impl Default for Sorm {
    fn default() -> Self {
        Self { form: Form::default(), formula: Formula::default(), step: 0.05 }
    }
}

impl Component for Sorm {
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        self.form.check(context, complaints);
        positive("step", self.step, complaints);
    }
}

impl Reliability for Sorm {
    fn needs_standard_normal(&self) -> bool {
        true
    }

    fn estimate(
        &self,
        state: &dyn LimitState,
        stream: &Stream,
        progress: &Progress<'_>,
    ) -> Result<Estimate, Stop> {
        standard_normal("sorm", state)?;
        let counted = Counted::new(state, progress);
        let found = self.form.find(&counted, &stream.named("search"))?;
        let points: Vec<DesignPoint> = found.iter().map(|f| f.design.clone()).collect();
        let (mut sum, mut planes, mut unusable) = (0.0, 0.0, false);
        for found in &found {
            let beta = found.design.distance;
            let curved = match curvature::principal(&counted, found, self.step)? {
                Some(curvatures) => formulas::probability(self.formula, beta, &curvatures),
                None => None,
            };
            unusable |= curved.is_none();
            let plane = normal_cdf(-beta);
            sum += curved.unwrap_or(plane);
            planes += plane;
        }
        let overlap =
            if planes > 0.0 { union(&points, &stream.named("union")) / planes } else { 1.0 };
        let mut estimate = approximation((sum * overlap).min(1.0), &counted, &found);
        if unusable {
            let text =
                "the curvature at a design point is unusable; its plane is used, as in `form`";
            estimate.warnings.push(text.to_owned());
            estimate.converged = false;
        }
        Ok(estimate)
    }
}

lacuna::register!(Reliability, "sorm", Sorm);
