//! The likelihoods of a library's discrepancies.

use std::ffi::c_void;

use super::{Guest, compressed, row_by_row};
use crate::linalg::Matrix;
use crate::math::random::Stream;
use crate::plugin::abi::Refusal;
use crate::plugin::abi::guard::{begin, end, fill, guard, object};
use crate::plugin::abi::linear::LinearView;
use crate::plugin::abi::table::{Answer, Compressed, Key, LikelihoodFunctions, Linear, Numbers};
use crate::plugin::discrepancy::{Likelihood, VariancePart};

type Own = Guest<dyn Likelihood>;

pub(super) static FUNCTIONS: LikelihoodFunctions = LikelihoodFunctions {
    size: size_of::<LikelihoodFunctions>(),
    destroy: Some(end::<Own>),
    hyperparameters: Some(hyperparameters),
    log_likelihood: Some(log_likelihood),
    gradient: Some(gradient),
    predictive: Some(predictive),
    simulate: Some(simulate),
    left_out: Some(left_out),
    compress: Some(compress),
    facts: Some(facts),
};

/// The likelihood behind the first argument.
///
/// # Safety
/// It was made by this library and not ended.
unsafe fn own<'a>(likelihood: *mut c_void) -> &'a Own {
    // SAFETY: as the caller promises.
    unsafe { object::<Own>(likelihood) }
}

/// A number as it crosses: what is no number is no density.
pub(super) fn density(value: f64) -> f64 {
    if value.is_nan() { f64::NEG_INFINITY } else { value }
}

unsafe extern "C" fn hyperparameters(this: *mut c_void, answer: *const Answer) -> i32 {
    // SAFETY: a likelihood of ours.
    guard(answer, |out| out.json(&unsafe { own(this) }.own.hyperparameters()))
}

unsafe extern "C" fn log_likelihood(
    this: *mut c_void,
    responses: Numbers,
    hyper: Numbers,
    values: *mut f64,
    answer: *const Answer,
) -> i32 {
    guard(answer, |_| {
        // SAFETY: a likelihood of ours, and numbers that are there for the time of the call.
        let (this, responses, hyper) = unsafe { (own(this), responses.matrix()?, hyper.matrix()?) };
        let all = this.own.log_likelihoods(&responses, &hyper);
        let all: Vec<f64> = all.into_iter().map(density).collect();
        // SAFETY: the buffer holds one number a response.
        unsafe { fill(values, responses.rows(), &all) }
    })
}

unsafe extern "C" fn gradient(
    this: *mut c_void,
    responses: Numbers,
    hyper: Numbers,
    by_response: *mut f64,
    by_hyper: *mut f64,
    answer: *const Answer,
) -> i32 {
    guard(answer, |_| {
        // SAFETY: as in `log_likelihood`.
        let (this, responses, hyper) = unsafe { (own(this), responses.matrix()?, hyper.matrix()?) };
        let one = |response: &[f64], hyper: &[f64]| this.own.gradient(response, hyper);
        let (a, b) = row_by_row(&responses, &hyper, one);
        // SAFETY: the buffers hold one row a response.
        unsafe {
            fill(by_response, responses.as_slice().len(), &a)?;
            fill(by_hyper, hyper.as_slice().len(), &b)
        }
    })
}

unsafe extern "C" fn predictive(
    this: *mut c_void,
    response: Numbers,
    hyper: Numbers,
    answer: *const Answer,
) -> i32 {
    guard(answer, |out| {
        // SAFETY: as in `log_likelihood`.
        let (this, response, hyper) = unsafe { (own(this), response.slice()?, hyper.slice()?) };
        let parts: Vec<VariancePart> = this.own.predictive(response, hyper);
        out.json(&parts.iter().map(|part| &part.origin).collect::<Vec<_>>())?;
        out.numbers(&Matrix::from_rows(response.len(), parts.iter().map(|part| &part.variance)));
        Ok(())
    })
}

unsafe extern "C" fn simulate(
    this: *mut c_void,
    response: Numbers,
    hyper: Numbers,
    key: Key,
    values: *mut f64,
    answer: *const Answer,
) -> i32 {
    guard(answer, |_| {
        // SAFETY: as in `log_likelihood`.
        let (this, response, hyper) = unsafe { (own(this), response.slice()?, hyper.slice()?) };
        let made = this.own.simulate(response, hyper, &Stream::from_key(key.words));
        let [data] = &made[..] else {
            return Err(Refusal::stop(format!(
                "simulates {} sets of data where one belongs",
                made.len()
            )));
        };
        let all = data.replicates.iter().flat_map(|r| r.values.iter());
        let all: Vec<f64> = all.map(|value| value.unwrap_or(0.0)).collect();
        // SAFETY: the buffer holds `replicates x outputs` numbers, as the data that were handed over.
        unsafe { fill(values, data.replicates.len() * response.len(), &all) }
    })
}

unsafe extern "C" fn left_out(
    this: *mut c_void,
    response: Numbers,
    hyper: Numbers,
    answer: *const Answer,
) -> i32 {
    guard(answer, |out| {
        // SAFETY: as in `log_likelihood`.
        let (this, response, hyper) = unsafe { (own(this), response.slice()?, hyper.slice()?) };
        out.row(&this.own.left_out(response, hyper).ok_or_else(Refusal::absent)?);
        Ok(())
    })
}

unsafe extern "C" fn compress(
    this: *mut c_void,
    linear: *const Linear,
    made: *mut Compressed,
    answer: *const Answer,
) -> i32 {
    guard(answer, |_| {
        // SAFETY: a likelihood of ours, and a map that is there for the time of the call.
        let (this, view) = unsafe {
            let this = own(this);
            (this, LinearView::new(*linear, this.fault.clone())?)
        };
        let reduced = this.own.compress(&view);
        this.sound()?;
        let own = Guest::new(reduced.ok_or_else(Refusal::absent)?, this.fault.clone());
        let (size, compressed) = (size_of::<Compressed>(), begin(own));
        // SAFETY: the caller gives a place for one compressed likelihood.
        unsafe {
            *made = Compressed { size, compressed, functions: &raw const compressed::FUNCTIONS }
        };
        Ok(())
    })
}

unsafe extern "C" fn facts(this: *mut c_void, answer: *const Answer) -> i32 {
    // SAFETY: a likelihood of ours.
    guard(answer, |out| out.json(&unsafe { own(this) }.own.facts()))
}
