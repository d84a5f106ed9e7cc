//! `active_kriging`: a Gaussian process of the limit state, refined where its sign is in doubt.

mod choice;
mod learning;
mod process;

use lacuna::math::random::Stream;
use lacuna::plugin::reliability::{Estimate, LimitState};
use lacuna::plugin::{Component, Context, Reliability, Size};
use lacuna::run::{Progress, Stop};
use lacuna::text::Complaints;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::common::{Counted, at_least, between};
use super::subset_simulation::of_level;
use crate::surrogates::kriging::Kernel;

/// Active learning with Kriging: a Gaussian process replaces the limit state, and the model is called where the sign of the
/// process is in doubt, until the probability no longer depends on that doubt. For expensive models: some tens to
/// a few hundred calls, whatever the probability.
///
/// The probability is that of the mean of the process, by subset simulation with as many samples as `final_samples`; its
/// samples of all levels are the candidates for the next call, so that rare events are reached. The next call is the one
/// that removes most of the doubt about the sign over all candidates. The interval contains the error of
/// the sampling and, at two standard deviations of the process, that of the process.
///
/// It needs a limit state that is continuous and, in this implementation, at most about 20 parameters. It works from a posterior.
///
/// References: Echard, Gayton and Lemaire, Structural Safety 33 (2011) 145; Bect, Ginsbourger, Li, Picheny and Vazquez,
/// Stat. Comput. 22 (2012) 773; Moustapha, Marelli and Sudret, Structural Safety 96 (2022) 102174.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ActiveKriging {
    /// Number of calls before the first process is fitted. Default: twice the number of parameters plus 2, at least 6.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub initial: Option<usize>,
    /// Largest number of calls.
    pub calls: usize,
    /// Number of calls that are made together. Larger numbers serve a model that runs in parallel; the total number of calls rises a little.
    pub batch: usize,
    /// Doubt at which the refinement ends: the expected probability of a wrong sign, as a share of the probability of
    /// failure.
    pub precision: f64,
    /// Number of calls in a row that must confirm the sign of the process when the doubt is small: each at the point farthest from
    /// all others at the distance at which a failure region would matter, so that a part of the failure region far from
    /// those already found is not missed. Default: twice the number of parameters, at least 4 and at most 10.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub checks: Option<usize>,
    /// Number of samples of each level while the process is refined. They cost no calls.
    pub samples: usize,
    /// Number of samples of each level for the final probability, in four repetitions.
    pub final_samples: usize,
    /// Correlation function of the process.
    pub kernel: Kernel,
}

impl Default for ActiveKriging {
    fn default() -> Self {
        Self {
            initial: None,
            calls: 200,
            batch: 1,
            precision: 0.05,
            checks: None,
            samples: 2000,
            final_samples: 200_000,
            kernel: Kernel::default(),
        }
    }
}

impl Component for ActiveKriging {
    fn check(&self, _context: &Context<'_>, complaints: &mut Complaints<'_>) {
        if let Some(initial) = self.initial {
            at_least("initial", initial, 4, complaints);
        }
        at_least("calls", self.calls, 5, complaints);
        at_least("batch", self.batch, 1, complaints);
        between("precision", self.precision, (0.0, 1.0), complaints);
        at_least("samples", self.samples, 500, complaints);
        at_least("final_samples", self.final_samples, 1000, complaints);
    }

    fn room(&self, unknowns: usize) -> Vec<Size> {
        // One repetition has a part of the final samples, and the four results are kept.
        vec![
            of_level("samples", self.samples, unknowns),
            of_level("final_samples", self.final_samples, unknowns),
        ]
    }
}

impl Reliability for ActiveKriging {
    fn estimate(
        &self,
        state: &dyn LimitState,
        stream: &Stream,
        progress: &Progress<'_>,
    ) -> Result<Estimate, Stop> {
        let counted = Counted::new(state, progress);
        learning::Learning::new(self, state, &counted, stream).run()
    }
}

lacuna::register!(Reliability, "active_kriging", ActiveKriging);
