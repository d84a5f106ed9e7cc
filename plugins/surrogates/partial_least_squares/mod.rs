//! `partial_least_squares`: expansions in a few directions of many parameters.

mod curve;
mod directions;
mod emulator;
mod fit;
mod inputs;

#[cfg(test)]
mod tests;

use lacuna::math::random::Stream;
use lacuna::plugin::surrogate::{Surrogate, Training};
use lacuna::plugin::{Component, Context, Emulator};
use lacuna::run::{Progress, Stop};
use lacuna::text::problem::Complaints;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use self::emulator::Reduced;
use self::inputs::Input;
use super::polynomial_chaos::{Degree, DegreeRange, PolynomialChaos};
use super::principal_components::Components;

/// A polynomial chaos expansion in a few directions of the parameters, found by partial least squares (PLS-PCE).
///
/// Use it for tens to a hundred parameters and a few hundred runs, if the response depends on the parameters mainly
/// through a few linear combinations of them, such as the coefficients of a random field. If it does not, the error
/// says so, and `polynomial_chaos` is the better choice. `docs/many_inputs.md` compares both.
///
/// Each parameter is put on a scale with mean zero and variance one under its design: linear for bounded and normal
/// designs, logarithmic for log-uniform and log-normal ones, the normal score for other unbounded ones. The outputs are
/// reduced to principal components. For each component nonlinear partial least squares finds one direction after the
/// other: the covariance of the parameters with what is not yet explained, refined along a polynomial fitted to it.
/// A sparse expansion of `polynomial_chaos` is fitted in the positions along the directions.
///
/// The number of directions is the one with the smallest error at left-out runs. Directions and expansion are both
/// found without these runs, so that the error is not too small because the directions were fitted to the same runs;
/// the residuals of the report are those of the left-out runs. A function that is even in every parameter, about the mean
/// of the design, covaries with none of them, and cannot be fitted.
///
/// References: Papaioannou, Ehre and Straub, *PLS-based adaptation for efficient PCE representation in high
/// dimensions*, Journal of Computational Physics 387 (2019) 186; Wold, Kettaneh-Wold and Skagerberg, *Nonlinear PLS
/// modeling*, Chemometrics and Intelligent Laboratory Systems 7 (1989) 53.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PartialLeastSquares {
    /// Maximum number of directions of a component.
    pub max_directions: usize,
    /// Maximum number of steps that refine a direction along its polynomial; 0 is linear partial least squares.
    pub refinements: usize,
    /// Degree of the expansion in the positions along the directions, or the range of degrees from which each component
    /// takes the best.
    pub degree: Degree,
    /// Maximum number of terms of a degree; degrees with more terms are not tried.
    pub max_terms: usize,
    /// Number of groups of runs that are left out in turn, at least 2; with fewer runs each is left out alone.
    pub folds: usize,
    /// Principal components of the outputs: as many as carry a fraction of the variance, `{ variance = 0.9999 }`, or
    /// `{ count = 20 }`; `"none"` gives every output directions of its own.
    pub components: Components,
}

impl Default for PartialLeastSquares {
    fn default() -> Self {
        Self {
            max_directions: 10,
            refinements: 5,
            degree: Degree::Range(DegreeRange { min: 1, max: 10 }),
            max_terms: 1000,
            folds: 10,
            components: Components::Variance(0.9999),
        }
    }
}

const NAME: &str = "partial_least_squares";

/// Highest degree that may be requested.
const MOST_DEGREES: usize = 100;

impl PartialLeastSquares {
    fn expansion(&self) -> PolynomialChaos {
        let max_terms = Some(self.max_terms);
        PolynomialChaos { degree: self.degree, max_terms, ..PolynomialChaos::default() }
    }

    /// Returns what is wrong with the options: the option, and a description.
    fn faults(&self, runs: Option<usize>) -> Vec<(&'static str, String)> {
        let mut faults = Vec::new();
        if self.max_directions == 0 {
            faults.push(("max_directions", "the expansion needs at least one direction".to_owned()));
        }
        let DegreeRange { min, max } = self.degree.range();
        if min == 0 || min > max || max > MOST_DEGREES {
            faults.push((
                "degree",
                format!("the degrees must be an increasing range from 1 to {MOST_DEGREES}, not {min} to {max}"),
            ));
        }
        let least = terms(self.max_directions, min);
        if least > self.max_terms as f64 {
            let (most, found) = (self.max_directions, self.max_terms);
            faults.push((
                "max_terms",
                format!(
                    "degree {min} in {most} directions has {least} terms, more than `max_terms` = {found}"
                ),
            ));
        }
        if self.folds < 2 {
            let found = self.folds;
            faults.push(("folds", format!("at least 2 groups of runs are needed, not {found}")));
        } else if let Some(runs) = runs.filter(|&runs| runs - runs.div_ceil(self.folds.min(runs)) < 3)
        {
            let message = format!(
                "fewer than 3 of {runs} runs remain if one of {} groups is left out",
                self.folds.min(runs)
            );
            faults.push(("folds", message));
        }
        faults.extend(self.components.fault().map(|words| ("components", words)));
        faults
    }
}

/// Returns the number of polynomials of at most this degree in that many variables, `C(variables + degree, degree)`.
fn terms(variables: usize, degree: usize) -> f64 {
    (1..=degree.min(MOST_DEGREES)).fold(1.0, |n, k| n * (variables + k) as f64 / k as f64).round()
}

impl Component for PartialLeastSquares {
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        for (key, message) in self.faults(context.runs.filter(|&runs| runs > 3)) {
            complaints.at(key).say(message);
        }
        for message in context.parameters.iter().filter_map(|p| Input::of(p).err()) {
            complaints.at("use").say(message);
        }
        if context.parameters.is_empty() {
            complaints
                .at("use")
                .say("directions of the parameters need at least one parameter")
                .help("add a `[[parameter]]`");
        }
    }
}

impl Surrogate for PartialLeastSquares {
    fn fit(
        &self,
        training: &Training<'_>,
        stream: &Stream,
        progress: &Progress<'_>,
    ) -> Result<Box<dyn Emulator>, Stop> {
        Ok(Box::new(fit::fit(self, training, stream, progress)?))
    }

    fn load(&self, bytes: &[u8]) -> Result<Box<dyn Emulator>, Stop> {
        Ok(Box::new(Reduced::from_bytes(bytes)?))
    }
}

lacuna::register!(Surrogate, "partial_least_squares", PartialLeastSquares, aliases: ["pls_pce", "pls"]);
