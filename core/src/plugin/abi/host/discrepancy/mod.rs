//! Discrepancies of libraries.

mod compressed;
mod known;
mod likelihood;

use super::Plugin;
use super::object::{Object, finite_only, numbers_only, shaped};
use super::plugin::optional;
use crate::data::{Layout, Measurements};
use crate::plugin::Likelihood;
use crate::plugin::abi::Refusal;
use crate::plugin::abi::table::{self, DiscrepancyFunctions, Numbers, Text};
use crate::plugin::discrepancy::{Discrepancy, Known, StatedNoise};
use crate::run::Stop;
use known::HandedKnown;
use likelihood::LoadedLikelihood;

/// A place for a likelihood.
fn nothing() -> table::Likelihood {
    table::Likelihood { size: 0, likelihood: std::ptr::null_mut(), functions: std::ptr::null() }
}

impl Plugin<DiscrepancyFunctions> {
    fn made(&self, known: &Known<'_>) -> Result<LoadedLikelihood, Refusal> {
        let handed = HandedKnown::of(known)?;
        let mut made = nothing();
        handed.with(|known| {
            let (ask, this, to) =
                (self.object.functions.likelihood, self.object.this, &raw mut made);
            // SAFETY: the function belongs to the plugin; what is known and the place are there until it returns.
            self.object
                .demand("likelihood", |a| optional(ask, |f| unsafe { f(this, known, to, a) }))
        })?;
        self.taken(&made, known.data)
    }

    fn made_of_part(
        &self,
        known: &Known<'_>,
        part: &Measurements,
    ) -> Result<Option<LoadedLikelihood>, Refusal> {
        let Some(ask) = self.object.functions.likelihood_of_part else { return Ok(None) };
        let of_part = Known { data: part, ..*known };
        let (whole, less) = (HandedKnown::of(known)?, HandedKnown::of(&of_part)?);
        let mut made = nothing();
        let (this, to) = (self.object.this, &raw mut made);
        let call = |whole, less, a| {
            // SAFETY: as in `made`; the part is there until it returns too.
            unsafe { ask(this, whole, less, to, a) }
        };
        let reply = whole.with(|whole| {
            less.with(|less| self.object.ask("likelihood_of_part", |a| call(whole, less, a)))
        })?;
        reply.map(|_| self.taken(&made, part)).transpose()
    }

    /// The likelihood that a call made.
    fn taken(
        &self,
        made: &table::Likelihood,
        data: &Measurements,
    ) -> Result<LoadedLikelihood, Refusal> {
        let (what, fault) = ("likelihood", self.object.fault().clone());
        // SAFETY: whoever made the likelihood gave it over with its table, a constant.
        let object = unsafe {
            Object::made(what, made.likelihood, made.functions, |table| table.destroy, fault)?
        };
        LoadedLikelihood::new(object, data)
    }

    fn noise(&self, layout: &Layout, response: &[f64]) -> Result<Option<StatedNoise>, Refusal> {
        let (ask, this) = (self.object.functions.stated_noise, self.object.this);
        if ask.is_none() {
            return Ok(None);
        }
        let layout = serde_json::to_string(layout)?;
        let (layout, row) = (Text::of(&layout), Numbers::row(response));
        // SAFETY: the function belongs to the plugin; layout and response are there until it returns.
        let call = |a| optional(ask, |f| unsafe { f(this, layout, row, a) });
        let Some(reply) = self.object.ask("stated_noise", call)? else { return Ok(None) };
        let count = reply.matrices.len();
        if count == 0 || count > 2 {
            let message = format!("`stated_noise` answers {count} rows, expected one or two");
            return Err(Refusal::stop(message));
        }
        for matrix in &reply.matrices {
            shaped("stated_noise", matrix, 1, response.len())?;
            finite_only("stated_noise", matrix.as_slice())?;
        }
        let mut rows = reply.matrices.into_iter().map(crate::linalg::Matrix::into_vec);
        let sd = rows.next().ok_or_else(|| Refusal::stop("`stated_noise` answers nothing"))?;
        Ok(Some(StatedNoise { sd, correlation_time: rows.next() }))
    }
}

impl Discrepancy for Plugin<DiscrepancyFunctions> {
    fn likelihood(&self, known: &Known<'_>) -> Result<Box<dyn Likelihood>, Stop> {
        Ok(Box::new(self.object.or_stop(self.made(known))?))
    }

    fn likelihood_of_part(
        &self,
        known: &Known<'_>,
        part: &Measurements,
    ) -> Result<Option<Box<dyn Likelihood>>, Stop> {
        let made = self.object.or_stop(self.made_of_part(known, part))?;
        Ok(made.map(|made| -> Box<dyn Likelihood> { Box::new(made) }))
    }

    fn takes_stated_noise(&self) -> bool {
        let (ask, this) = (self.object.functions.takes_stated_noise, self.object.this);
        // SAFETY: the function belongs to the plugin, and the place for the mark is there until it returns.
        let call = |to, a| optional(ask, |f| unsafe { f(this, to, a) });
        self.object.or_fault(self.object.mark("takes_stated_noise", false, call), || false)
    }

    fn stated_noise(&self, layout: &Layout, response: &[f64]) -> Option<StatedNoise> {
        self.object.or_fault(self.noise(layout, response), || None)
    }
}

/// Derivatives at one point: by its coordinates, and by the hyperparameters.
type Slopes = (Vec<f64>, Vec<f64>);

/// Asks for derivatives at one point. They must be numbers where the density is one; where it is zero, as `density` says
/// when it is asked, there are none.
fn slopes<F>(
    object: &Object<F>,
    (coordinates, unknowns): (usize, usize),
    call: impl FnOnce(*mut f64, *mut f64, *const table::Answer) -> i32,
    density: impl FnOnce() -> f64,
) -> Slopes {
    let nothing = || (vec![0.0; coordinates], vec![0.0; unknowns]);
    let mut by_hyper = vec![f64::NAN; unknowns];
    let beside = by_hyper.as_mut_ptr();
    let absent = || Refusal::stop("`gradient` is not there");
    let asked = object
        .ask_filled("gradient", coordinates, |to, answer| call(to, beside, answer))
        .and_then(|first| first.ok_or_else(absent));
    let checked = asked.and_then(|first| {
        let sound =
            numbers_only("gradient", &first).and_then(|()| numbers_only("gradient", &by_hyper));
        match sound {
            Err(refusal) if density().is_finite() => Err(refusal),
            Err(_) => Ok(nothing()),
            Ok(()) => Ok((first, by_hyper)),
        }
    });
    object.or_fault(checked, nothing)
}
