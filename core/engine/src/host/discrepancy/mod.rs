//! Discrepancies of libraries.

mod compressed;
mod known;
mod likelihood;

use lacuna::data::{Layout, Measurements};
use lacuna::plugin::Likelihood;
use lacuna::plugin::discrepancy::{Discrepancy, Known, StatedNoise};
use lacuna::run::Stop;
use lacuna_abi::check::{finite_only, numbers_only, shaped};
use lacuna_abi::object::{Asked, filled_if_any, mark};
use lacuna_abi::table::{self, DiscrepancyFunctions};
use lacuna_abi::{Object, Refusal};

use super::Plugin;
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
        // SAFETY: what is known is there until the call returns, and there is a place for one likelihood.
        let asked = handed.with(|known| unsafe { self.object.likelihood(known, &raw mut made) });
        asked.demand()?;
        self.taken(&made, known.data)
    }

    fn made_of_part(
        &self,
        known: &Known<'_>,
        part: &Measurements,
    ) -> Result<Option<LoadedLikelihood>, Refusal> {
        if self.object.functions.likelihood_of_part.is_none() {
            return Ok(None);
        }
        let of_part = Known { data: part, ..*known };
        let (whole, less) = (HandedKnown::of(known)?, HandedKnown::of(&of_part)?);
        let mut made = nothing();
        let to = &raw mut made;
        // SAFETY: as in `made`; the part is there until the call returns too.
        let call = |whole, less| unsafe { self.object.likelihood_of_part(whole, less, to) };
        let asked = whole.with(|whole| less.with(|less| call(whole, less)));
        asked.if_any()?.map(|_| self.taken(&made, part)).transpose()
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
        let layout = serde_json::to_string(layout)?;
        // SAFETY: nothing is written.
        let asked = unsafe { self.object.stated_noise(&layout, response) };
        let Some(reply) = asked.if_any()? else { return Ok(None) };
        let count = reply.matrices.len();
        if count == 0 || count > 2 {
            let message = format!("`stated_noise` answers {count} rows, expected one or two");
            return Err(Refusal::stop(message));
        }
        for matrix in &reply.matrices {
            shaped("stated_noise", matrix, 1, response.len())?;
            finite_only("stated_noise", matrix.as_slice())?;
        }
        let mut rows = reply.matrices.into_iter().map(lacuna_linalg::Matrix::into_vec);
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
        // SAFETY: there is a place for one mark.
        let takes = mark(false, |to| unsafe { self.object.takes_stated_noise(to) });
        self.object.or_fault(takes, || false)
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
    call: impl FnOnce(*mut f64, *mut f64) -> Asked,
    density: impl FnOnce() -> f64,
) -> Slopes {
    let nothing = || (vec![0.0; coordinates], vec![0.0; unknowns]);
    let mut by_hyper = vec![f64::NAN; unknowns];
    let beside = by_hyper.as_mut_ptr();
    let absent = || Refusal::stop("`gradient` is not there");
    let asked = filled_if_any(coordinates, |to| call(to, beside))
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
