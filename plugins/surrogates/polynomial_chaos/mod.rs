//! `polynomial_chaos`: expansions in orthonormal polynomials of the parameters.

pub(super) mod bytes;
mod candidates;
mod emulator;
mod family;
mod fit;
mod least_angle;
mod least_squares;
mod options;
mod sensitivity;
mod squares;
mod terms;
mod trend;

#[cfg(test)]
mod tests;

use lacuna::data::Parameter;
use lacuna::math::random::Stream;
use lacuna::plugin::surrogate::{Surrogate, Training};
use lacuna::plugin::{Component, Context, Emulator};
use lacuna::run::{Progress, Stop};
use lacuna::study::problem::Complaints;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use emulator::{Expansion, Summary};
pub use family::{Coordinate, Family};
pub(super) use fit::check_numbers;
pub use options::{Degree, DegreeRange, EarlyStop, Solver};
pub use terms::{Basis, Nested, Terms, Truncation};

/// A polynomial chaos expansion: each output is a sum of products of orthonormal polynomials in the
/// parameters.
///
/// The polynomials are orthonormal under the *design's* distribution, so that the coefficients give mean,
/// variance and Sobol' indices without sampling. All outputs are fitted as one problem: they share the
/// basis and its Gram matrix. For each output and each degree, least-angle regression proposes one term after the other;
/// every proposed set is fitted by least squares and judged by its leave-one-out error,
/// corrected for the number of terms by `N / (N - P) (1 + tr (Psi' Psi)^-1)`. The output keeps the set
/// and the degree with the least error. Outputs that do not vary over the runs, but for round-off, are emulated by their
/// mean and have the error 0.
///
/// Outside the design's range the polynomials are extrapolated, and grow quickly there.
///
/// References: Blatman and Sudret, *Adaptive sparse polynomial chaos expansion based on least angle
/// regression*, Journal of Computational Physics 230 (2011) 2345; Efron, Hastie, Johnstone and
/// Tibshirani, *Least angle regression*, Annals of Statistics 32 (2004) 407; Chapelle, Vapnik and
/// Bengio, *Model selection for small sample regression*, Machine Learning 48 (2002) 9; Sudret,
/// *Global sensitivity analysis using polynomial chaos expansions*, Reliability Engineering and System
/// Safety 93 (2008) 964.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PolynomialChaos {
    /// The family of polynomials.
    pub basis: Family,
    /// How the coefficients are found.
    pub solver: Solver,
    /// The degree, or the range of degrees from which each output takes its best.
    pub degree: Degree,
    /// Which products belong to a degree `p`: those whose exponents have
    /// `(sum of exponent^q_norm)^(1 / q_norm) <= p`. With 1 this is the total degree; smaller values
    /// leave out products of many parameters.
    pub q_norm: f64,
    /// The most parameters that may appear together in a product; all when not given.
    pub max_interaction: Option<usize>,
    /// Degrees with more terms than this are not tried.
    pub max_terms: usize,
    /// When to stop looking for something better.
    pub early_stop: EarlyStop,
}

impl Default for PolynomialChaos {
    fn default() -> Self {
        Self {
            basis: Family::default(),
            solver: Solver::default(),
            degree: Degree::default(),
            q_norm: 1.0,
            max_interaction: None,
            max_terms: 4000,
            early_stop: EarlyStop::default(),
        }
    }
}

/// What is wrong with the options in view of the rest of the study.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Fault {
    /// The option.
    key: &'static str,
    message: String,
    help: String,
}

impl PolynomialChaos {
    /// The nested sets of terms for so many parameters.
    fn nested(&self, dimension: usize) -> Nested {
        let truncation = Truncation {
            q_norm: self.q_norm,
            max_interaction: self.max_interaction.unwrap_or(dimension),
        };
        Nested::new(dimension, self.degree.range().max, truncation, self.max_terms)
    }

    /// All that is wrong with the options for these parameters and runs.
    fn faults(&self, parameters: &[Parameter], runs: Option<usize>) -> Vec<Fault> {
        let mut faults = self.faults_alone();
        if parameters.is_empty() {
            let message = "a polynomial chaos expansion needs at least one parameter".to_owned();
            faults.push(Fault { key: "use", message, help: "add a `[[parameter]]`".to_owned() });
        }
        for message in parameters.iter().filter_map(|p| self.basis.coordinate(p).err()) {
            let help =
                "give the parameter `design = { uniform = [low, high] }`; its prior may differ";
            faults.push(Fault { key: "basis", message, help: help.to_owned() });
        }
        if faults.is_empty() {
            faults.extend(self.fault_of_size(parameters.len(), runs));
        }
        faults
    }

    fn faults_alone(&self) -> Vec<Fault> {
        let mut faults = Vec::new();
        let mut add = |key, message: String, help: &str| {
            faults.push(Fault { key, message, help: help.to_owned() });
        };
        let DegreeRange { min, max } = self.degree.range();
        if min == 0 || min > max || max > 1000 {
            let message = format!("the degrees {min} to {max} are no range between 1 and 1000");
            add("degree", message, "write `degree = { min = 1, max = 20 }` or a whole number");
        }
        if !(self.q_norm > 0.0 && self.q_norm <= 1.0) {
            let message = format!("`q_norm` is {}, but must be above 0 and at most 1", self.q_norm);
            add("q_norm", message, "1 is the total degree; values from 0.4 to 1 are usual");
        }
        if self.max_interaction == Some(0) {
            let message =
                "`max_interaction` is 0, which leaves no term but the constant".to_owned();
            add("max_interaction", message, "1 allows no products, 2 products of two parameters");
        }
        faults
    }

    /// Whether the basis is too large: for the option's limit, or for the runs.
    fn fault_of_size(&self, dimension: usize, runs: Option<usize>) -> Option<Fault> {
        let DegreeRange { min, max } = self.degree.range();
        let counts = self.nested(dimension).counts;
        if counts.len() <= min {
            return Some(Fault {
                key: "degree",
                message: format!(
                    "degree {min} in {dimension} parameters has more than `max_terms` = {} terms",
                    self.max_terms
                ),
                help: format!("the largest degree that fits is {}", counts.len() - 1),
            });
        }
        let runs = runs.filter(|_| self.solver == Solver::LeastSquares)?;
        let fits = counts.iter().take_while(|&&terms| terms < runs).count().max(1) - 1;
        if fits >= max {
            return None;
        }
        let terms = counts
            .get(max)
            .map_or_else(|| format!("more than {}", self.max_terms), ToString::to_string);
        Some(Fault {
            key: "degree",
            message: format!(
                "least squares of degree {max} has {terms} terms, but there are only {runs} runs"
            ),
            help: format!(
                "the largest degree that fits is {fits}; `solver = \"least_angle_regression\"` can \
                 choose among more terms than runs"
            ),
        })
    }
}

impl Component for PolynomialChaos {
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        for fault in self.faults(context.parameters, context.runs) {
            complaints.at(fault.key).say(fault.message).help(fault.help);
        }
    }
}

impl Surrogate for PolynomialChaos {
    fn fit(
        &self,
        training: &Training<'_>,
        _stream: &Stream,
        progress: &Progress<'_>,
    ) -> Result<Box<dyn Emulator>, Stop> {
        Ok(Box::new(fit::fit(self, training, progress)?))
    }

    fn load(&self, bytes: &[u8]) -> Result<Box<dyn Emulator>, Stop> {
        Ok(Box::new(Expansion::from_bytes(bytes)?))
    }
}

lacuna::register!(Surrogate, "polynomial_chaos", PolynomialChaos);
