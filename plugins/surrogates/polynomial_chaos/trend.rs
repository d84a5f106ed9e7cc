//! An expansion as a part of other surrogates.

use lacuna::math::random::Stream;
use lacuna::plugin::Context;
use lacuna::plugin::surrogate::Training;
use lacuna::run::{Progress, Stop, Tasks};
use lacuna::text::problem::Complaints;

use super::PolynomialChaos;
use super::emulator::Expansion;
use super::fit::fit;

impl PolynomialChaos {
    /// Fits the expansion of all outputs.
    pub fn expand(
        &self,
        training: &Training<'_>,
        stream: &Stream,
        progress: &Progress<'_>,
    ) -> Result<Expansion, Stop> {
        fit(self, training, stream, progress, Tasks::here())
    }

    /// Reports errors of the options in a table of another plugin's options.
    pub(in crate::surrogates) fn check_within(
        &self,
        table: &str,
        context: &Context<'_>,
        complaints: &mut Complaints<'_>,
    ) {
        for fault in self.faults(context.parameters, context.runs) {
            let place = format!("{table}.{}", fault.key);
            complaints.at(&place).say(fault.message).help(fault.help);
        }
    }
}
