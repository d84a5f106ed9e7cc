//! Errors of emulators that are fitted without some of the runs.

use lacuna::plugin::Surrogate;
use lacuna::plugin::surrogate::Training;
use lacuna::run::{Progress, Silent, Stop, Tasks};

use super::fit::Fit;
use super::rotated::Rotated;
use super::{Purpose, plugin};
use crate::stage::emulator_error::{Curves, Runs};
use crate::stage::stream;

/// Refits of [large](Runs::are_large) tables use the axes of the runs if there are more than this many times as many
/// outputs as runs.
const TIMES: usize = 4;

impl Fit<'_> {
    /// Errors at training runs that were left out of the fit ([`Curves::refitted`]), of these runs those that are `shown`;
    /// `None` if that takes too long, or the emulator is not that of the study.
    pub(super) fn refitted(&self, runs: Runs<'_>, shown: &[usize]) -> Result<Option<Curves>, Stop> {
        let Runs { points, responses } = runs;
        if self.fitting.purpose != Purpose::Study {
            return Ok(None);
        }
        let Some(surrogate) = self.rotating(runs)? else {
            let all = Curves::refitted(runs, |kept, left| {
                self.emulator(points, responses, kept, left, (Tasks::here(), &Silent))
            })?;
            let whole = shown.len() == points.rows();
            return Ok(all.map(|curves| if whole { curves } else { curves.select(shown) }));
        };
        if !Curves::are_refitted(points.rows()) {
            return Ok(None);
        }
        let rotated = Rotated::of(responses)?;
        let parameters = self.used.parameters(self.fitting.parameters);
        let own = Runs { points, responses: &rotated.scores };
        let curves = Curves::refitted(own, |kept, _| {
            let training = Training {
                parameters: &parameters,
                layouts: &self.study.layouts,
                points: &self.used.points(&points.select_rows(kept)),
                responses: &rotated.scores.select_rows(kept),
                gradients: None,
            };
            let random = stream(self.study, "surrogate");
            let emulator = surrogate.fit(&training, &random, &Progress::new(&Silent))?;
            Ok(self.used.clone().widen(emulator))
        })?;
        Ok(curves.map(|curves| {
            let curves = curves.select(shown);
            let errors = rotated.to_outputs(&curves.errors, responses);
            Curves { errors, stated: None, ..curves }
        }))
    }

    /// The surrogate for outputs in the axes of the runs, if there are many and its fit does not depend on the axes.
    fn rotating(&self, runs: Runs<'_>) -> Result<Option<Box<dyn Surrogate>>, Stop> {
        let are_large = runs.are_large();
        let (runs, outputs) = (runs.responses.rows(), runs.responses.columns());
        let alone = self.gradients.is_none() && self.data.cheaper.is_none();
        if !alone || !are_large || outputs <= TIMES * runs {
            return Ok(None);
        }
        Ok(plugin(self.study)?.rotated(runs, outputs))
    }
}
