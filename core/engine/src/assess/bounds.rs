//! Posteriors that are concentrated at a bound.

use super::words::{percent, short};
use super::{Finding, Rule, Severity};

const CODE: &str = "posterior_at_bound";

/// Distance, in posterior standard deviations, up to which a draw counts as lying at a bound.
pub const NEAR: f64 = 0.5;
/// Fractions of draws at a bound that give a reservation and a failure.
const SHARE: (f64, f64) = (0.2, 0.33);
/// Number of bounds, and fraction of the parameters, from which on the finding is a failure.
const MANY: (usize, f64) = (3, 0.5);

const WIDEN: &str = "widen the prior (and the design, with runs there) if values beyond the bound are possible; \
                     otherwise search for missing physics: `lacuna gap STUDY`";

/// Rules of this module; see [`super::rules`].
pub fn rules() -> Vec<Rule> {
    vec![Rule {
        code: CODE,
        looks_at: format!(
            "the fraction of draws within {NEAR} posterior sd of a bound of prior or region, on the scale on which \
             the prior is uniform; a uniform density has 14 %, half a normal distribution 24 %, an exponential \
             distribution 39 %"
        ),
        threshold: format!(
            "{}: reservation; {}: failure, unless the bound is a physical limit (0 and 1); at least {} parameters \
             and {} of all at bounds: failure; the bound of a distribution that extends to infinity on the other \
             side, such as that of a scale: note",
            percent(SHARE.0),
            percent(SHARE.1),
            MANY.0,
            percent(MANY.1)
        ),
        why: "the data favour values beyond the bound: 33 % corresponds to a best fit two standard deviations \
              beyond it, and the other parameters compensate",
        action: WIDEN,
    }]
}

/// Position of a parameter relative to one of its bounds.
#[derive(Debug, Clone, PartialEq)]
pub struct AtBound {
    /// Name of the parameter.
    pub name: String,
    /// Value of the bound.
    pub bound: f64,
    /// Origin of the bound: `prior` or `region`.
    pub whose: String,
    /// Fraction of draws within [`NEAR`] standard deviations of the bound.
    pub share: f64,
    /// True if the distribution extends to infinity on the other side, as that of a scale: the bound is then natural
    /// and was not chosen.
    pub natural: bool,
}

impl AtBound {
    fn is_physical(&self) -> bool {
        self.whose == "prior" && (self.bound == 0.0 || self.bound == 1.0)
    }
}

/// Findings about parameters concentrated at a bound; `parameters` is the number of all parameters.
pub fn at_bound(all: &[AtBound], parameters: usize) -> Vec<Finding> {
    let piled: Vec<&AtBound> = all.iter().filter(|at| at.share >= SHARE.0).collect();
    let chosen = piled.iter().filter(|at| !at.natural).count();
    let many = chosen >= MANY.0 && chosen as f64 >= MANY.1 * parameters as f64;
    let one = |at: &&AtBound| {
        let far = at.share >= SHARE.1 && !at.is_physical();
        let severity = match at.natural {
            true => Severity::Note,
            false if far || many => Severity::Failure,
            false => Severity::Reservation,
        };
        let together = if many {
            format!("; {chosen} of {parameters} parameters are at bounds")
        } else {
            String::new()
        };
        let message = format!(
            "{} of the posterior lies within {NEAR} standard deviations of the bound {} of the {} (a uniform \
             density has 14 %): the data may favour values beyond it{together}",
            percent(at.share),
            short(at.bound),
            at.whose
        );
        Finding::new((CODE, &at.name), (at.share, SHARE.0), severity, message, WIDEN)
    };
    piled.iter().map(one).collect()
}
