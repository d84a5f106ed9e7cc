//! `polynomial_chaos_kriging`: a Gaussian process around a sparse polynomial chaos expansion.

#[cfg(test)]
mod tests;

use lacuna::linalg::Matrix;
use lacuna::math::random::Stream;
use lacuna::plugin::forward::Linear;
use lacuna::plugin::surrogate::{Surrogate, Training};
use lacuna::plugin::{Component, Context, Emulator};
use lacuna::run::{Progress, Silent, Stop};
use lacuna::study::problem::Complaints;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::kriging::{
    Bounds, Kernel, Kriging, LengthScales, Nugget, Regressors, Settings, Standard, Trends,
};
use super::polynomial_chaos::{Basis, Expansion, PolynomialChaos};
use super::principal_components::Components;

/// Kriging with a trend of sparse polynomials: the polynomials give the response's global shape, a Gaussian process what is
/// left between the runs.
///
/// Use it where `polynomial_chaos` and `gaussian_process` are each good at a part of the response: smooth over the
/// whole design, with local features. It is seldom worse than either, and dearer than both. Far outside of the
/// design the polynomials are extrapolated, and grow quickly.
///
/// The outputs are reduced to principal components. For each of them a sparse polynomial chaos expansion chooses
/// the polynomials; their coefficients are then found anew by generalised least squares under the covariance of the
/// process (universal kriging), whose length scales and nugget are those of the largest restricted likelihood, as in
/// `gaussian_process`. With `selection = "optimal"` the largest half of the polynomials, the largest quarter, and so on down
/// to the constant alone are tried too, and the least leave-one-out error (corrected for the number of
/// terms) decides; the last of them is ordinary kriging.
///
/// References: Schöbi, Sudret and Wiart, *Polynomial-chaos-based Kriging*, International Journal for Uncertainty
/// Quantification 5 (2015) 171; those of `polynomial_chaos` and `gaussian_process`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PolynomialChaosKriging {
    /// How the polynomials are chosen: the options of `polynomial_chaos`.
    pub trend: PolynomialChaos,
    /// How many of the chosen polynomials are kept.
    pub selection: Selection,
    /// How the correlation of two points falls with their distance.
    pub kernel: Kernel,
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

/// How many of the chosen polynomials are kept.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Selection {
    /// All of them, the largest half, the largest quarter, ..., or none but the constant, by the leave-one-out error.
    #[default]
    Optimal,
    /// All of them.
    Sequential,
}

impl Default for PolynomialChaosKriging {
    fn default() -> Self {
        Self {
            trend: PolynomialChaos::default(),
            selection: Selection::default(),
            kernel: Kernel::default(),
            nugget: Nugget::default(),
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
            components: self.components,
            starts: self.starts,
            bounds: self.bounds,
        }
    }

    /// Fits trends and processes to all outputs.
    pub fn krige(
        &self,
        training: &Training<'_>,
        stream: &Stream,
        progress: &Progress<'_>,
    ) -> Result<Kriging, Stop> {
        let trends = |_: &[Standard], scores: &Matrix| self.trends(training, scores, stream);
        self.settings().fit(training, trends, stream, progress)
    }

    /// The polynomials that each component's expansion has chosen.
    fn trends(
        &self,
        training: &Training<'_>,
        scores: &Matrix,
        stream: &Stream,
    ) -> Result<Trends, Stop> {
        if scores.columns() == 0 {
            return Ok(Trends { regressors: Regressors::Constant, candidates: Vec::new() });
        }
        let of_scores = Training { responses: scores, ..*training };
        let expansion =
            self.trend.expand(&of_scores, &stream.named("trend"), &Progress::new(&Silent))?;
        let candidates = (0..scores.columns())
            .map(|c| self.candidates(&expansion, c, training.points.rows()))
            .collect();
        let basis = Basis::new(expansion.basis_coordinates(), expansion.terms().clone());
        Ok(Trends { regressors: Regressors::Polynomials(basis), candidates })
    }

    /// The sets of terms that one component may have.
    fn candidates(&self, expansion: &Expansion, component: usize, runs: usize) -> Vec<Vec<usize>> {
        let (coefficients, terms) = (expansion.coefficients(), expansion.terms());
        let size = |t: usize| coefficients[(t, component)].abs();
        let is_constant = |t: &usize| terms.term(*t).iter().all(|e| *e == 0);
        let constant = (0..terms.len()).find(is_constant);
        let mut chosen: Vec<usize> =
            (0..terms.len()).filter(|&t| Some(t) != constant && size(t) > 0.0).collect();
        chosen.sort_by(|&a, &b| size(b).total_cmp(&size(a)).then(a.cmp(&b)));
        // With fewer runs than twice the terms little is left to estimate the process from.
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
        Ok(Box::new(self.krige(training, stream, progress)?))
    }

    fn load(&self, bytes: &[u8]) -> Result<Box<dyn Emulator>, Stop> {
        Ok(Box::new(Kriging::from_bytes(NAME, bytes)?))
    }
}

lacuna::register!(Surrogate, "polynomial_chaos_kriging", PolynomialChaosKriging, aliases: ["pck", "pc_kriging", "pce_kriging"]);
