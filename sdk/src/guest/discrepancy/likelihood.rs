//! The likelihoods of a library's discrepancies.

use lacuna::math::random::Stream;
use lacuna::matrix::Matrix;
use lacuna::plugin::discrepancy::{Likelihood, VariancePart};
use lacuna_abi::Refusal;
use lacuna_abi::argument::{Buffer, Lent, Rows, Space};
use lacuna_abi::guard::{Done, Out, begin};
use lacuna_abi::linear::LinearView;
use lacuna_abi::table::{Compressed, LikelihoodFunctions, Linear, ServeLikelihood};

use super::{Guest, compressed, row_by_row};

type Own = Guest<dyn Likelihood>;

pub(super) static FUNCTIONS: LikelihoodFunctions = LikelihoodFunctions::of::<Own>();

/// A number as it crosses: what is no number is no density.
pub(super) fn density(value: f64) -> f64 {
    if value.is_nan() { f64::NEG_INFINITY } else { value }
}

impl ServeLikelihood for Own {
    fn hyperparameters(&self, out: &Out) -> Done {
        out.json(&self.own.hyperparameters())
    }

    fn log_likelihood(
        &self,
        responses: Rows<'_>,
        hyper: Rows<'_>,
        to: Buffer<'_>,
        _: &Out,
    ) -> Done {
        let all = self.own.log_likelihoods(&responses.matrix(), &hyper.matrix());
        let all: Vec<f64> = all.into_iter().map(density).collect();
        // SAFETY: the buffer holds one number a response.
        unsafe { to.fill(responses.rows, &all) }
    }

    fn gradient(
        &self,
        responses: Rows<'_>,
        hyper: Rows<'_>,
        by_response: Buffer<'_>,
        by_hyper: Buffer<'_>,
        _: &Out,
    ) -> Done {
        let one = |response: &[f64], hyper: &[f64]| self.own.gradient(response, hyper);
        let (a, b) = row_by_row(&responses.matrix(), &hyper.matrix(), one);
        // SAFETY: the buffers hold one row a response.
        unsafe {
            by_response.fill(responses.len(), &a)?;
            by_hyper.fill(hyper.len(), &b)
        }
    }

    fn predictive(&self, response: Rows<'_>, hyper: Rows<'_>, out: &Out) -> Done {
        let parts: Vec<VariancePart> = self.own.predictive(&response, &hyper);
        out.json(&parts.iter().map(|part| &part.origin).collect::<Vec<_>>())?;
        out.numbers(&Matrix::from_rows(response.len(), parts.iter().map(|part| &part.variance)));
        Ok(())
    }

    fn simulate(
        &self,
        response: Rows<'_>,
        hyper: Rows<'_>,
        key: Stream,
        to: Buffer<'_>,
        _: &Out,
    ) -> Done {
        let made = self.own.simulate(&response, &hyper, &key);
        let [data] = &made[..] else {
            let count = made.len();
            return Err(Refusal::stop(format!("simulates {count} sets of data where one belongs")));
        };
        let all = data.replicates.iter().flat_map(|r| r.values.iter());
        let all: Vec<f64> = all.map(|value| value.unwrap_or(0.0)).collect();
        // SAFETY: the buffer holds `replicates x outputs` numbers, as the data that were handed over.
        unsafe { to.fill(data.replicates.len() * response.len(), &all) }
    }

    fn left_out(&self, response: Rows<'_>, hyper: Rows<'_>, out: &Out) -> Done {
        out.row(&self.own.left_out(&response, &hyper).ok_or_else(Refusal::absent)?);
        Ok(())
    }

    fn compress(&self, linear: Lent<'_, Linear>, made: Space<'_, Compressed>, _: &Out) -> Done {
        // SAFETY: the table gives a map, which is there for the time of the call; no view is kept.
        let view = unsafe { LinearView::new(*linear.one(), self.fault.clone())? };
        let reduced = self.own.compress(&view);
        self.sound()?;
        let own = Guest::new(reduced.ok_or_else(Refusal::absent)?, self.fault.clone());
        let (size, compressed) = (size_of::<Compressed>(), begin(own));
        let functions = &raw const compressed::FUNCTIONS;
        // SAFETY: the caller gives a place for one compressed likelihood.
        unsafe { made.put(Compressed { size, compressed, functions }) };
        Ok(())
    }

    fn facts(&self, out: &Out) -> Done {
        out.json(&self.own.facts())
    }

    fn is_cheap(&self, cheap: Space<'_, u8>, _: &Out) -> Done {
        // SAFETY: the caller gives a place for one mark.
        unsafe { cheap.put(u8::from(self.own.is_cheap())) };
        Ok(())
    }

    fn sampled_errors(&self, hyper: Rows<'_>, out: &Out) -> Done {
        let errors = self.own.sampled_errors(&hyper).ok_or_else(Refusal::absent)?;
        out.row(&errors.noise);
        out.numbers(&errors.sampled);
        out.numbers(&errors.left_out);
        Ok(())
    }
}
