//! `gaussian`: independent normal differences of one unknown variance.

mod compressed;
mod likelihood;
#[cfg(test)]
mod tests;

use lacuna::math::distribution::Distribution;
use lacuna::plugin::component::{Component, Context};
use lacuna::plugin::discrepancy::{Discrepancy, Known, Likelihood};
use lacuna::run::Stop;
use lacuna::study::problem::Complaints;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use likelihood::GaussianLikelihood;

/// Independent normal differences between data and model, all of one unknown variance.
///
/// Every measured value is the model's response plus a normal number of mean zero and the
/// unknown `variance` (homoscedastic; Radaideh et al. arXiv 2202.03959, equation of the likelihood). Errors that
/// all replicates share, such as the emulator's own, are further normal errors, correlated between
/// outputs: their covariance is added once to that of the mean curve.
///
/// The likelihood uses the count, mean and scatter of the replicates of each output, which are
/// sufficient; with a linear emulator it is reduced further, by an orthogonal factorisation, to
/// the size of the emulator's basis. Both are exact.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Gaussian {
    /// Prior of the variance, in the squared unit of the response, such as `{ half_normal = 1e-6 }`. It is sampled
    /// as its logarithm, with the Jacobian, so that the prior keeps its meaning.
    pub variance: Distribution,
}

impl Component for Gaussian {
    fn check(&self, _context: &Context<'_>, complaints: &mut Complaints<'_>) {
        let (low, high) = self.variance.support();
        if low < 0.0 || high <= 0.0 {
            complaints
                .at("variance")
                .say("a variance is never negative")
                .expected("a prior on positive values, such as `{ half_normal = 1e-6 }`")
                .found(&self.variance);
        }
    }
}

impl Discrepancy for Gaussian {
    fn likelihood(&self, known: &Known<'_>) -> Result<Box<dyn Likelihood>, Stop> {
        Ok(Box::new(GaussianLikelihood::new(known.data, known.common, self.variance.clone())?))
    }
}

lacuna::register!(Discrepancy, "gaussian", Gaussian);
