//! Discrepancies of a library.

mod compressed;
mod known;
mod likelihood;

use std::sync::Arc;

use lacuna::matrix::Matrix;
use lacuna::plugin;
use lacuna::plugin::discrepancy::Discrepancy;
use lacuna::run::fault::Fault;
use lacuna_abi::Refusal;
use lacuna_abi::argument::{Lent, Rows, Space};
use lacuna_abi::guard::{Done, Out, begin};
use lacuna_abi::table::{Known, Likelihood, ServeDiscrepancy};

use super::{Authored, Plugin};
use known::OwnedKnown;

/// An object of the library with what may go wrong in what it asks of the program.
struct Guest<O: ?Sized> {
    own: Box<O>,
    fault: Arc<Fault>,
}

impl<O: ?Sized> Guest<O> {
    fn new(own: Box<O>, fault: Arc<Fault>) -> Self {
        Self { own, fault }
    }

    /// An error where the program failed to answer.
    fn sound(&self) -> Done {
        self.fault.said().map_or(Ok(()), |said| Err(Refusal::stop(said)))
    }
}

/// Hands a likelihood over.
fn handed(own: Box<dyn plugin::Likelihood>) -> Likelihood {
    let fault = Arc::new(Fault::new("the program"));
    Likelihood {
        size: size_of::<Likelihood>(),
        likelihood: begin(Guest::new(own, fault)),
        functions: &raw const likelihood::FUNCTIONS,
    }
}

/// The data from which a likelihood is made.
fn read(known: Lent<'_, Known>) -> Result<OwnedKnown<'_>, Refusal> {
    // SAFETY: the table gives what is known, and all that it points to is there for the time of the call.
    unsafe { OwnedKnown::read(known.one()) }
}

impl<T: Discrepancy + Authored> ServeDiscrepancy for Plugin<T> {
    fn likelihood(&self, known: Lent<'_, Known>, made: Space<'_, Likelihood>, _: &Out) -> Done {
        let own = read(known)?.with(|known| self.0.likelihood(known))?;
        // SAFETY: the caller gives a place for one likelihood.
        unsafe { made.put(handed(own)) };
        Ok(())
    }

    fn likelihood_of_part(
        &self,
        known: Lent<'_, Known>,
        part: Lent<'_, Known>,
        made: Space<'_, Likelihood>,
        _: &Out,
    ) -> Done {
        let (known, part) = (read(known)?, read(part)?);
        let own = known.with(|known| self.0.likelihood_of_part(known, part.data()))?;
        let own = own.ok_or_else(Refusal::absent)?;
        // SAFETY: the caller gives a place for one likelihood.
        unsafe { made.put(handed(own)) };
        Ok(())
    }

    fn takes_stated_noise(&self, takes: Space<'_, u8>, _: &Out) -> Done {
        // SAFETY: the caller gives a place for one mark.
        unsafe { takes.put(u8::from(self.0.takes_stated_noise())) };
        Ok(())
    }

    fn stated_noise(&self, layout: &[u8], response: Rows<'_>, out: &Out) -> Done {
        let layout = serde_json::from_slice(layout)?;
        let noise = self.0.stated_noise(&layout, &response).ok_or_else(Refusal::absent)?;
        out.row(&noise.sd);
        noise.correlation_time.iter().for_each(|times| out.row(times));
        Ok(())
    }
}

/// The rows of two matrices side by side, each made into a pair of rows.
fn row_by_row(
    first: &Matrix,
    second: &Matrix,
    pair: impl Fn(&[f64], &[f64]) -> (Vec<f64>, Vec<f64>),
) -> (Vec<f64>, Vec<f64>) {
    let (mut by_first, mut by_second) = (Vec::new(), Vec::new());
    for (a, b) in first.iter_rows().zip(second.iter_rows()) {
        let (x, y) = pair(a, b);
        by_first.extend(x);
        by_second.extend(y);
    }
    (by_first, by_second)
}
