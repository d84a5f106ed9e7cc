//! `gaussian_process`: the response as a draw from a Gaussian process.

#[cfg(test)]
pub(super) mod tests;

use lacuna::math::random::Stream;
use lacuna::plugin::surrogate::{Surrogate, Training};
use lacuna::plugin::{Component, Context, Emulator};
use lacuna::run::{Progress, Stop};
use lacuna::study::problem::Complaints;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::kriging::{
    Bounds, Kernel, Kriging, LengthScales, Nugget, Regressors, Settings, Standard, Trends,
};
use super::principal_components::Components;

/// A Gaussian process: the response between the runs is what a random function of that smoothness would be,
/// given the runs.
///
/// Use it for few runs (tens to some hundreds) of a smooth response, and where the emulator's own uncertainty at
/// each point matters: it is the one surrogate here whose variance grows away from the runs. Time grows
/// with the cube of the number of runs; for many more of them, or to know Sobol' indices, take
/// `polynomial_chaos`.
///
/// The outputs are reduced to a few principal components, each of which is one Gaussian process of the parameters with a
/// trend, a length scale for each parameter and a nugget (noise). The length scales and the nugget are those of
/// the largest marginal likelihood, the trend's coefficients integrated out under a flat prior and the process's variance at its
/// restricted estimate (REML). They are searched for from several starts by L-BFGS-B with the exact gradient.
/// Leave-one-out errors are exact for the hyperparameters and components found, and so a little optimistic. The variance is
/// that of a new run about the emulator's mean: it includes the uncertainty of the trend, the nugget and what the
/// components leave out, but not the uncertainty of the hyperparameters.
///
/// Parameters are measured on the scale of their design, log-uniform and log-normal ones by their logarithms. Far outside
/// of the design the mean returns to the trend.
///
/// References: Rasmussen and Williams, *Gaussian Processes for Machine Learning*, MIT Press 2006; Sacks, Welch, Mitchell and
/// Wynn, *Design and analysis of computer experiments*, Statistical Science 4 (1989) 409; Higdon, Gattiker, Williams and
/// Rightley, *Computer model calibration using high-dimensional output*, Journal of the American
/// Statistical Association 103 (2008) 570; Dubrule, *Cross validation of kriging in a unique neighborhood*,
/// Mathematical Geology 15 (1983) 687; Harville, *Bayesian inference for variance components using
/// only error contrasts*, Biometrika 61 (1974) 383.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct GaussianProcess {
    /// How the correlation of two points falls with their distance.
    pub kernel: Kernel,
    /// What the response is like far from all runs.
    pub trend: Trend,
    /// Whether each component has length scales and a nugget of its own.
    pub length_scales: LengthScales,
    /// What runs differ by besides the smooth response, as a share of the variance of the process: a number, or
    /// `"estimated"`.
    pub nugget: Nugget,
    /// The principal components of the outputs: as many as carry a share of the variance, `{ variance = 0.99999 }`, or
    /// `{ count = 20 }`; `"none"` gives every output a process of its own.
    pub components: Components,
    /// How many starts the search for the hyperparameters has.
    pub starts: usize,
    /// Where the hyperparameters are looked for.
    pub bounds: Bounds,
}

/// What the response is like far from all runs.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Trend {
    /// A constant.
    #[default]
    Constant,
    /// A linear function of the parameters.
    Linear,
}

impl Default for GaussianProcess {
    fn default() -> Self {
        Self {
            kernel: Kernel::default(),
            trend: Trend::default(),
            length_scales: LengthScales::default(),
            nugget: Nugget::default(),
            components: Components::Variance(0.99999),
            starts: 4,
            bounds: Bounds::default(),
        }
    }
}

const NAME: &str = "gaussian_process";

impl GaussianProcess {
    fn settings(&self) -> Settings {
        Settings {
            plugin: NAME,
            kernel: self.kernel,
            length_scales: self.length_scales,
            nugget: self.nugget,
            components: self.components,
            starts: self.starts,
            bounds: self.bounds,
        }
    }

    fn regressors(&self, standards: &[Standard]) -> Regressors {
        match self.trend {
            Trend::Constant => Regressors::Constant,
            Trend::Linear => Regressors::Linear(standards.to_vec()),
        }
    }

    /// Fits the processes to all outputs.
    pub fn krige(
        &self,
        training: &Training<'_>,
        stream: &Stream,
        progress: &Progress<'_>,
    ) -> Result<Kriging, Stop> {
        let trends = |standards: &[Standard], scores: &lacuna::linalg::Matrix| {
            Ok(Trends::all(self.regressors(standards), scores.columns()))
        };
        self.settings().fit(training, trends, stream, progress)
    }
}

impl Component for GaussianProcess {
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        self.settings().check(context, complaints);
    }
}

impl Surrogate for GaussianProcess {
    fn fit(
        &self,
        training: &Training<'_>,
        stream: &Stream,
        progress: &Progress<'_>,
    ) -> Result<Box<dyn Emulator>, Stop> {
        Ok(Box::new(self.krige(training, stream, progress)?))
    }

    fn load(&self, bytes: &[u8]) -> Result<Box<dyn Emulator>, Stop> {
        Ok(Box::new(Kriging::from_bytes(NAME, bytes)?))
    }
}

lacuna::register!(Surrogate, "gaussian_process", GaussianProcess, aliases: ["gp", "gpr", "kriging"]);
