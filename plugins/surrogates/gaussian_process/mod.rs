//! `gaussian_process`: the response as a realisation of a Gaussian process.

#[cfg(test)]
pub(super) mod tests;

use lacuna::math::random::Stream;
use lacuna::plugin::surrogate::{Surrogate, Training};
use lacuna::plugin::{Component, Context, Emulator};
use lacuna::run::{Progress, Stop, Tasks};
use lacuna::text::problem::Complaints;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::kriging::{
    Approximation, Bounds, Kernel, Kriging, LengthScales, Nugget, Regressors, Settings, Standard,
    Trends,
};
use super::principal_components::Components;

/// Gaussian process regression (kriging): between the runs the response is interpolated as a Gaussian process
/// conditioned on the runs.
///
/// Use it for few runs (tens to some hundreds) of a smooth response, or for many thousands of runs with local features,
/// and if the emulator's own uncertainty at each point matters: among the surrogates only this one and
/// `polynomial_chaos_kriging` have a variance that grows away from the runs. For Sobol' indices use `polynomial_chaos`.
///
/// The outputs are reduced to a few principal components. Each component is one Gaussian process of the parameters
/// with a trend, a length scale for each parameter and a nugget (noise). Length scales and nugget maximise the
/// marginal likelihood, with the trend's coefficients integrated out under a flat prior and the variance of the
/// process at its restricted estimate (REML); the maximum is sought from several starts by L-BFGS-B with the exact
/// gradient. Leave-one-out errors are exact for the hyperparameters and components found, and therefore slightly
/// optimistic. The variance is that of a new run about the emulator's mean: it includes the uncertainty of the trend,
/// the nugget and the part that the components leave out, but not the uncertainty of the hyperparameters.
///
/// With more than 2000 runs (`approximation`) no covariance of all runs is factored, whose time grows with the cube of
/// their number. The likelihood is that of each run given its nearest predecessors in an order from coarse to fine
/// (Vecchia's approximation; neighbours in the metric of the length scales), summed over at most 2000 runs spread evenly
/// over the order. The search begins with the exact likelihood of 1000 runs. The mean stays that of all runs, smooth and
/// with an exact gradient: its weights solve the equations of the exact covariance by conjugate gradients, which that
/// approximation preconditions, to a hundredth of the typical standard error. The variance is that of the best prediction from the
/// nearest runs alone, an upper bound for that of the mean; so are the leave-one-out errors. As neighbours change from point to
/// point, the variance has small jumps. Where the equations are too nearly dependent (`"squared_exponential"`; smooth
/// responses without noise in many dimensions) the nugget is raised until they can be solved, and the report shows it.
/// The memory grows with runs times neighbours, the time for the weights with the square of the runs.
///
/// Parameters are measured on the scale of their design, log-uniform and log-normal ones by their logarithms. Far
/// outside the design the mean returns to the trend.
///
/// References: Rasmussen and Williams, *Gaussian Processes for Machine Learning*, MIT Press 2006; Sacks, Welch,
/// Mitchell and Wynn, *Design and analysis of computer experiments*, Statistical Science 4 (1989) 409; Higdon,
/// Gattiker, Williams and Rightley, *Computer model calibration using high-dimensional output*, Journal of the
/// American Statistical Association 103 (2008) 570; Dubrule, *Cross validation of kriging in a unique neighborhood*,
/// Mathematical Geology 15 (1983) 687; Harville, *Bayesian inference for variance components using only error
/// contrasts*, Biometrika 61 (1974) 383; Vecchia, *Estimation and model identification for continuous spatial
/// processes*, Journal of the Royal Statistical Society B 50 (1988) 297; Guinness, *Permutation and grouping methods for
/// sharpening Gaussian process approximations*, Technometrics 60 (2018) 415; Guinness, *Gaussian process learning via
/// Fisher scoring of Vecchia's approximation*, Statistics and Computing 31 (2021) 25; Katzfuss and Guinness, *A general
/// framework for Vecchia approximations of Gaussian processes*, Statistical Science 36 (2021) 124; Katzfuss, Guinness and
/// Lawrence, *Scaled Vecchia approximation for fast computer-model emulation*, SIAM/ASA Journal on Uncertainty
/// Quantification 10 (2022) 537.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct GaussianProcess {
    /// Correlation of two points as a function of their distance; it sets the smoothness of the response.
    pub kernel: Kernel,
    /// Mean of the process far from all runs.
    pub trend: Trend,
    /// Choice between separate and common length scales and nuggets of the components.
    pub length_scales: LengthScales,
    /// Variance of the noise of the runs (the deviation from a smooth response), as a fraction of the variance of the
    /// process: a number, or `"estimated"`.
    pub nugget: Nugget,
    /// Covariance of the runs: `"exact"`, or `{ neighbours = 100 }` for that of each run with its nearest ones, which
    /// takes less time and memory with many runs; `"automatic"` is exact with at most 2000 runs.
    pub approximation: Approximation,
    /// Principal components of the outputs: as many as carry a fraction of the variance, `{ variance = 0.99999 }`, or
    /// `{ count = 20 }`; `"none"` gives every output a process of its own.
    pub components: Components,
    /// Number of starts of the search for the hyperparameters, at least 1. More starts take longer and are less
    /// likely to miss the global maximum.
    pub starts: usize,
    /// Bounds of the hyperparameters.
    pub bounds: Bounds,
}

/// Mean of the process far from all runs.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Trend {
    /// Constant mean.
    #[default]
    Constant,
    /// Linear function of the parameters.
    Linear,
}

impl Default for GaussianProcess {
    fn default() -> Self {
        Self {
            kernel: Kernel::default(),
            trend: Trend::default(),
            length_scales: LengthScales::default(),
            nugget: Nugget::default(),
            approximation: Approximation::default(),
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
            approximation: self.approximation,
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

    /// Fits the processes to all outputs; fails if the options or the runs do not permit it.
    pub fn krige(
        &self,
        training: &Training<'_>,
        stream: &Stream,
        progress: &Progress<'_>,
        tasks: Tasks<'_>,
    ) -> Result<Kriging, Stop> {
        let trends = |standards: &[Standard], scores: &lacuna_linalg::Matrix| {
            Ok(Trends::all(self.regressors(standards), scores.columns()))
        };
        self.settings().fit(training, trends, stream, progress, tasks)
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
        self.fit_with_tasks(training, stream, progress, Tasks::here())
    }

    fn fit_with_tasks(
        &self,
        training: &Training<'_>,
        stream: &Stream,
        progress: &Progress<'_>,
        tasks: Tasks<'_>,
    ) -> Result<Box<dyn Emulator>, Stop> {
        Ok(Box::new(self.krige(training, stream, progress, tasks)?))
    }

    fn load(&self, bytes: &[u8]) -> Result<Box<dyn Emulator>, Stop> {
        Ok(Box::new(Kriging::from_bytes(NAME, bytes)?))
    }
}

lacuna::register!(Surrogate, "gaussian_process", GaussianProcess, aliases: ["gp", "gpr", "kriging"]);
