//! Fits to outputs in other axes.

use lacuna::math::random::Stream;
use lacuna::plugin::surrogate::Training;
use lacuna::plugin::{Component, Emulator, Surrogate};
use lacuna::run::{Progress, Stop, Tasks};

use super::PolynomialChaos;
use super::fit::fit_with;
use super::reduction::Reduction;

/// The surrogate for outputs whose axes do not matter, because components are fitted in their place.
pub(super) struct Rotated {
    options: PolynomialChaos,
    reduction: Reduction,
}

impl Rotated {
    /// Returns the surrogate in place of that for `runs x outputs` values, if it fits components to them.
    pub fn of(options: &PolynomialChaos, runs: usize, outputs: usize) -> Option<Self> {
        let reduction = options.reduction(runs, outputs)?;
        Some(Self { options: options.clone(), reduction })
    }
}

impl Component for Rotated {}

impl Surrogate for Rotated {
    fn fit(
        &self,
        training: &Training<'_>,
        stream: &Stream,
        progress: &Progress<'_>,
    ) -> Result<Box<dyn Emulator>, Stop> {
        Ok(Box::new(fit_with(
            &self.options,
            Some(self.reduction),
            training,
            stream,
            progress,
            Tasks::here(),
        )?))
    }

    fn load(&self, bytes: &[u8]) -> Result<Box<dyn Emulator>, Stop> {
        self.options.load(bytes)
    }
}
