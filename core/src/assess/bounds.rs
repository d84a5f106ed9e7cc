//! Posteriors that are piled on a bound.

use super::words::{percent, short};
use super::{Finding, Rule, Severity};

const CODE: &str = "posterior_at_bound";

/// How far from a bound, in posterior standard deviations, a draw lies at it.
pub const NEAR: f64 = 0.5;
/// The shares of draws there that are a reservation and a failure.
const SHARE: (f64, f64) = (0.2, 0.33);
/// At how many bounds, and at what share of the parameters, the whole is a failure.
const MANY: (usize, f64) = (3, 0.5);

const WIDEN: &str = "widen the prior (and the design, with runs there) if the value is possible; if not, look \
                     for what the model lacks: `lacuna gap STUDY`";

/// See [`super::rules`].
pub fn rules() -> Vec<Rule> {
    vec![Rule {
        code: CODE,
        looks_at: format!(
            "the share of draws within {NEAR} posterior sd of a bound of prior or region, on the scale on \
             which the prior is flat; a flat density has 14 %, half a normal law 24 %, an exponential law 39 %"
        ),
        threshold: format!(
            "{}: reservation; {}: failure, unless the bound is a physical limit (0 and 1); at least {} \
             parameters and {} of all at bounds: failure; the end of a law that reaches to infinity on the other side, such as \
             that of a scale: note",
            percent(SHARE.0),
            percent(SHARE.1),
            MANY.0,
            percent(MANY.1)
        ),
        why: "the data want a value beyond the bound; 33 % is a best fit two standard deviations beyond it, and \
              the other parameters make up for it",
        action: WIDEN,
    }]
}

/// How a parameter lies to one of its bounds.
#[derive(Debug, Clone, PartialEq)]
pub struct AtBound {
    /// The parameter.
    pub name: String,
    /// The bound.
    pub bound: f64,
    /// Whose bound it is: `prior` or `region`.
    pub whose: String,
    /// The share of draws within [`NEAR`] standard deviations of it.
    pub share: f64,
    /// Whether the law reaches to infinity on the other side, as that of a scale: then nobody chose this bound.
    pub natural: bool,
}

impl AtBound {
    fn is_physical(&self) -> bool {
        self.whose == "prior" && (self.bound == 0.0 || self.bound == 1.0)
    }
}

/// The parameters that are piled on a bound, out of so many.
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
            "{} of the posterior lie within {NEAR} standard deviations of the bound {} of the {} (a \
             flat density has 14 %): the data may want a value beyond it{together}",
            percent(at.share),
            short(at.bound),
            at.whose
        );
        Finding::new((CODE, &at.name), (at.share, SHARE.0), severity, message, WIDEN)
    };
    piled.iter().map(one).collect()
}
