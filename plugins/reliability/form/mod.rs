//! `form`: the first-order reliability method.

mod points;
mod search;

use lacuna::math::random::Stream;
use lacuna::plugin::reliability::{DesignPoint, Estimate, LimitState};
use lacuna::plugin::{Component, Context, Reliability};
use lacuna::run::{Progress, Stop};
use lacuna::text::Complaints;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use self::points::{design_points, pick, union};
pub use self::search::{Found, Settings};
use super::common::{Counted, at_least, between, positive, standard_normal};

/// First-order reliability method: the limit state is replaced by planes at its design points, the points of the failure
/// region nearest to the origin of the standard normal space.
///
/// With one design point at the distance `beta` the probability is `Phi(-beta)`; with several it is that of the union of
/// the half-spaces. The points are found with the iteration of Hasofer, Lind, Rackwitz and Fiessler and a line search; a
/// further point is sought with the limit state raised around those already found. The gradient is taken by forward
/// differences, so an iteration costs one call more than there are parameters.
///
/// The probability has an error that the method does not know: that of the curvature of the limit state, and of design
/// points that the search missed. Use `importance_sampling` to remove it. It needs independent priors, not a posterior.
///
/// References: Rackwitz and Fiessler, Computers and Structures 9 (1978) 489; Zhang and Der Kiureghian, Proc. 6th IFIP WG
/// 7.5 (1995) 297; Der Kiureghian and Dakessian, Structural Safety 20 (1998) 37.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Form {
    /// Largest number of design points that are sought.
    pub design_points: usize,
    /// Largest number of iterations of one search.
    pub iterations: usize,
    /// Value of the limit state at the design point, relative to that at the start, at which a search ends.
    pub tolerance: f64,
    /// Step of the finite differences, in standard deviations.
    pub step: f64,
}

impl Default for Form {
    fn default() -> Self {
        Self { design_points: 4, iterations: 50, tolerance: 1e-3, step: 1e-3 }
    }
}

impl Component for Form {
    fn check(&self, _context: &Context<'_>, complaints: &mut Complaints<'_>) {
        at_least("design_points", self.design_points, 1, complaints);
        at_least("iterations", self.iterations, 1, complaints);
        between("tolerance", self.tolerance, (0.0, 0.1), complaints);
        positive("step", self.step, complaints);
    }
}

impl Form {
    /// Settings of its searches.
    pub fn settings(&self) -> Settings {
        Settings { step: self.step, tolerance: self.tolerance, iterations: self.iterations }
    }

    /// The design points.
    ///
    /// # Errors
    /// If the limit state has no answer or no slope wherever a search starts.
    pub fn find(&self, state: &Counted<'_>, stream: &Stream) -> Result<Vec<Found>, Stop> {
        let found = design_points(state, self.design_points, self.settings(), stream)?;
        if found.is_empty() {
            let message =
                "no design point is found: the limit state has no answer or no slope at the starts";
            return Err(Stop::new(message).help("use `subset_simulation`, which needs no gradient"));
        }
        Ok(found)
    }
}

impl Reliability for Form {
    fn needs_standard_normal(&self) -> bool {
        true
    }

    fn estimate(
        &self,
        state: &dyn LimitState,
        stream: &Stream,
        progress: &Progress<'_>,
    ) -> Result<Estimate, Stop> {
        standard_normal("form", state)?;
        let counted = Counted::new(state, progress);
        let found = self.find(&counted, &stream.named("search"))?;
        let points: Vec<DesignPoint> = found.iter().map(|f| f.design.clone()).collect();
        let probability = union(&points, &stream.named("union"));
        Ok(approximation(probability, &counted, &found))
    }
}

/// Estimate of a method that approximates the limit state at design points.
pub fn approximation(probability: f64, counted: &Counted<'_>, found: &[Found]) -> Estimate {
    let converged = found.iter().all(|found| found.converged);
    let mut warnings: Vec<String> = counted.warning().into_iter().collect();
    if !converged {
        warnings.push("the search for the design point did not converge".to_owned());
    }
    Estimate {
        probability,
        variation: None,
        interval: None,
        calls: counted.calls(),
        undefined: counted.undefined(),
        failures: None,
        design_points: found.iter().map(|found| found.design.clone()).collect(),
        converged,
        warnings,
    }
}

lacuna::register!(Reliability, "form", Form);
