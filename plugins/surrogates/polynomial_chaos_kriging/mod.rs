//! `polynomial_chaos_kriging`: a Gaussian process around a sparse polynomial chaos expansion.

#[cfg(test)]
mod tests;

use lacuna::math::random::Stream;
use lacuna::plugin::forward::Linear;
use lacuna::plugin::surrogate::{Surrogate, Training};
use lacuna::plugin::{Component, Context, Emulator};
use lacuna::run::{Progress, Silent, Stop, Tasks};
use lacuna::text::problem::Complaints;
use lacuna_linalg::Matrix;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::kriging::{
    Approximation, Bounds, Kernel, Kriging, LengthScales, Nugget, Regressors, Settings, Standard,
    Trends,
};
use super::polynomial_chaos::{Basis, Expansion, PolynomialChaos};
use super::principal_components::Components;

/// Kriging with a trend of sparse polynomials: the polynomials give the global shape of the response, a Gaussian
/// process the remainder between the runs.
///
/// Use it if `polynomial_chaos` and `gaussian_process` are each good at a part of the response: smooth over the whole
/// design, with local features. It is seldom less accurate than either, and costs more than both. Far outside the
/// design the polynomials are extrapolated, and grow quickly.
///
/// The outputs are reduced to principal components. For each of them a sparse polynomial chaos expansion chooses the
/// polynomials; their coefficients are then re-estimated by generalised least squares under the covariance of the
/// process (universal kriging), whose length scales and nugget maximise the restricted likelihood, as in
/// `gaussian_process`. With `selection = "optimal"` the largest half of the polynomials, the largest quarter, and so
/// on down to the constant alone are tried too, and the smallest leave-one-out error (corrected for the number of
/// terms) decides; the constant alone is ordinary kriging. With more than 2000 runs the processes are approximated as in
/// `gaussian_process` (`approximation`).
///
/// References: Schöbi, Sudret and Wiart, *Polynomial-chaos-based Kriging*, International Journal for Uncertainty
/// Quantification 5 (2015) 171; those of `polynomial_chaos` and `gaussian_process`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PolynomialChaosKriging {
    /// Expansion that chooses the polynomials: the options of `polynomial_chaos`.
    pub trend: PolynomialChaos,
    /// Selection among the chosen polynomials.
    pub selection: Selection,
    /// Correlation of two points as a function of their distance; it sets the smoothness of the remainder.
    pub kernel: Kernel,
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

/// Selection among the chosen polynomials.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Selection {
    /// The best, by the leave-one-out error, of all polynomials, the largest half, the largest quarter, ..., and the
    /// constant alone.
    #[default]
    Optimal,
    /// All polynomials.
    Sequential,
}

impl Default for PolynomialChaosKriging {
    fn default() -> Self {
        Self {
            trend: PolynomialChaos::default(),
            selection: Selection::default(),
            kernel: Kernel::default(),
            nugget: Nugget::default(),
            approximation: Approximation::default(),
            components: Components::Variance(0.99999),
            starts: 4,
            bounds: Bounds::default(),
        }
    }
}

const NAME: &str = "polynomial_chaos_kriging";

impl PolynomialChaosKriging {
    fn settings(&self) -> Settings {
        Settings {
            plugin: NAME,
            kernel: self.kernel,
            length_scales: LengthScales::Each,
            nugget: self.nugget,
            approximation: self.approximation,
            components: self.components,
            starts: self.starts,
            bounds: self.bounds,
        }
    }

    /// Fits trends and processes to all outputs; fails if the options or the runs do not permit it.
    pub fn krige(
        &self,
        training: &Training<'_>,
        stream: &Stream,
        progress: &Progress<'_>,
        tasks: Tasks<'_>,
    ) -> Result<Kriging, Stop> {
        let trends = |_: &[Standard], scores: &Matrix| self.trends(training, scores, stream);
        self.settings().fit(training, trends, stream, progress, tasks)
    }

    /// Returns the polynomials that each component's expansion has chosen.
    fn trends(
        &self,
        training: &Training<'_>,
        scores: &Matrix,
        stream: &Stream,
    ) -> Result<Trends, Stop> {
        if scores.columns() == 0 {
            return Ok(Trends { regressors: Regressors::Constant, candidates: Vec::new() });
        }
        let of_scores = Training { responses: scores, gradients: None, ..*training };
        let expansion =
            self.trend.expand(&of_scores, &stream.named("trend"), &Progress::new(&Silent))?;
        let candidates = (0..scores.columns())
            .map(|c| self.candidates(&expansion, c, training.points.rows()))
            .collect();
        let basis = Basis::new(expansion.basis_coordinates(), expansion.terms().clone());
        Ok(Trends { regressors: Regressors::Polynomials(basis), candidates })
    }

    /// Returns the sets of terms to be tried for one component.
    fn candidates(&self, expansion: &Expansion, component: usize, runs: usize) -> Vec<Vec<usize>> {
        let (coefficients, terms) = (expansion.coefficients(), expansion.terms());
        let size = |t: usize| coefficients[(t, component)].abs();
        let is_constant = |t: &usize| terms.term(*t).iter().all(|e| *e == 0);
        let constant = (0..terms.len()).find(is_constant);
        let mut chosen: Vec<usize> =
            (0..terms.len()).filter(|&t| Some(t) != constant && size(t) > 0.0).collect();
        chosen.sort_by(|&a, &b| size(b).total_cmp(&size(a)).then(a.cmp(&b)));
        // With fewer runs than twice the terms, little is left to estimate the process from.
        chosen.truncate((runs / 2).saturating_sub(1));
        let set = |count: usize| {
            let mut set: Vec<usize> =
                constant.into_iter().chain(chosen[..count].to_vec()).collect();
            set.sort_unstable();
            set
        };
        let mut sets = vec![set(chosen.len())];
        let mut count = chosen.len();
        while self.selection == Selection::Optimal && count > 0 {
            count /= 2;
            sets.push(set(count));
        }
        sets
    }
}

impl Component for PolynomialChaosKriging {
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        self.settings().check(context, complaints);
        self.trend.check_within("trend", context, complaints);
    }
}

impl Surrogate for PolynomialChaosKriging {
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

lacuna::register!(Surrogate, "polynomial_chaos_kriging", PolynomialChaosKriging, aliases: ["pck", "pc_kriging", "pce_kriging"], revision = 2);
