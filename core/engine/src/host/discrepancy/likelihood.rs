//! The likelihoods of libraries' discrepancies.

use lacuna::data::{Measurements, Replicate};
use lacuna::math::random::Stream;
use lacuna::plugin::discrepancy::{
    Compressed, ErrorOrigin, Likelihood, SampledErrors, VariancePart,
};
use lacuna::plugin::forward::Linear;
use lacuna::plugin::{Fact, Hyperparameter};
use lacuna_abi::check::{numbers_only, shaped};
use lacuna_abi::linear::ServedLinear;
use lacuna_abi::object::{densities, mark};
use lacuna_abi::table::{self, LikelihoodFunctions, Numbers};
use lacuna_abi::{Object, Refusal};
use lacuna_linalg::Matrix;

use super::compressed::LoadedCompressed;
use super::slopes;
use crate::host::plugin::unknowns;

/// A likelihood that a library computes.
pub(super) struct LoadedLikelihood {
    object: Object<LikelihoodFunctions>,
    hyper: Vec<Hyperparameter>,
    /// The measurements, whose gaps simulated data have.
    data: Measurements,
}

impl LoadedLikelihood {
    pub fn new(object: Object<LikelihoodFunctions>, data: &Measurements) -> Result<Self, Refusal> {
        // SAFETY: nothing is written.
        let reply = unsafe { object.hyperparameters() }.demand()?;
        Ok(Self { hyper: unknowns(reply)?, object, data: data.clone() })
    }

    fn values(&self, responses: Numbers, hyper: Numbers) -> Vec<f64> {
        // SAFETY: the buffer holds one number a response.
        let call = |to| unsafe { self.object.log_likelihood(responses, hyper, to) };
        let values = densities(responses.rows, call);
        self.object.or_fault(values, || vec![f64::NEG_INFINITY; responses.rows])
    }

    fn parts(&self, response: &[f64], hyper: &[f64]) -> Result<Vec<VariancePart>, Refusal> {
        // SAFETY: nothing is written.
        let reply = unsafe { self.object.predictive(response, hyper) }.demand()?;
        let origins: Vec<ErrorOrigin> = reply.json()?;
        let [variances] = reply.matrices()?;
        shaped("predictive", &variances, origins.len(), response.len())?;
        numbers_only("predictive", variances.as_slice())?;
        if let Some(x) = variances.as_slice().iter().find(|x| **x < 0.0) {
            return Err(Refusal::stop(format!("`predictive` gives the variance {x}")));
        }
        let rows = variances.iter_rows().map(<[f64]>::to_vec);
        let part = |(origin, variance)| VariancePart { origin, variance };
        Ok(origins.into_iter().zip(rows).map(part).collect())
    }

    fn simulated(
        &self,
        response: &[f64],
        hyper: &[f64],
        stream: &Stream,
    ) -> Result<Measurements, Refusal> {
        let outputs = self.data.layout.len();
        let mut values = Matrix::from_fn(self.data.replicates.len(), outputs, |_, _| f64::NAN);
        let to = values.as_mut_slice().as_mut_ptr();
        // SAFETY: the buffer holds `replicates x outputs` numbers.
        unsafe { self.object.simulate(response, hyper, stream, to) }.demand()?;
        let new = |(replicate, row): (&Replicate, &[f64])| {
            let value = |(old, &new): (&Option<f64>, &f64)| old.map(|_| new);
            let values = replicate.values.iter().zip(row).map(value).collect();
            Replicate { values, ..replicate.clone() }
        };
        let replicates: Vec<Replicate> =
            self.data.replicates.iter().zip(values.iter_rows()).map(new).collect();
        let measured: Vec<f64> =
            replicates.iter().flat_map(|r| r.values.iter().flatten().copied()).collect();
        numbers_only("simulate", &measured)?;
        Ok(self.data.with_replicates(replicates))
    }

    fn left(&self, response: &[f64], hyper: &[f64]) -> Result<Option<Vec<f64>>, Refusal> {
        // SAFETY: nothing is written.
        let asked = unsafe { self.object.left_out(response, hyper) };
        let Some(reply) = asked.if_any()? else { return Ok(None) };
        let row = reply.row()?;
        numbers_only("left_out", &row)?;
        if row.len() != self.data.count() {
            let (found, count) = (row.len(), self.data.count());
            return Err(Refusal::stop(format!(
                "`left_out` answers {found} numbers for {count} measured values"
            )));
        }
        Ok(Some(row))
    }

    fn sampled(&self, hyper: &[f64]) -> Result<Option<SampledErrors>, Refusal> {
        // SAFETY: nothing is written.
        let asked = unsafe { self.object.sampled_errors(hyper) };
        let Some(reply) = asked.if_any()? else { return Ok(None) };
        let [noise, sampled, left_out] = reply.matrices()?;
        let outputs = self.data.layout.len();
        shaped("sampled_errors", &noise, 1, outputs)?;
        for factor in [&sampled, &left_out] {
            shaped("sampled_errors", factor, outputs, factor.columns())?;
            numbers_only("sampled_errors", factor.as_slice())?;
        }
        let noise = noise.into_vec();
        if let Some(x) = noise.iter().find(|x| x.is_nan() || **x <= 0.0) {
            return Err(Refusal::stop(format!("`sampled_errors` gives the variance {x}")));
        }
        Ok(Some(SampledErrors { noise, sampled, left_out }))
    }

    fn reduced(&self, linear: &dyn Linear) -> Result<Option<LoadedCompressed>, Refusal> {
        let served = ServedLinear::new(linear);
        let (map, null) = (served.table(), std::ptr::null_mut());
        let mut made = table::Compressed { size: 0, compressed: null, functions: std::ptr::null() };
        // SAFETY: map and place are there until the call returns.
        let asked = unsafe { self.object.compress(&raw const map, &raw mut made) };
        if asked.if_any()?.is_none() {
            return Ok(None);
        }
        let (what, fault) = ("compressed likelihood", self.object.fault().clone());
        // SAFETY: whoever made the compressed likelihood gave it over with its table, a constant.
        let object = unsafe {
            Object::made(what, made.compressed, made.functions, |table| table.destroy, fault)?
        };
        Ok(Some(LoadedCompressed::new(object)))
    }
}

impl Likelihood for LoadedLikelihood {
    fn hyperparameters(&self) -> &[Hyperparameter] {
        &self.hyper
    }

    fn log_likelihood(&self, response: &[f64], hyper: &[f64]) -> f64 {
        self.values(Numbers::row(response), Numbers::row(hyper))[0]
    }

    fn log_likelihoods(&self, responses: &Matrix, hyper: &Matrix) -> Vec<f64> {
        self.values(Numbers::of(responses), Numbers::of(hyper))
    }

    fn left_out(&self, response: &[f64], hyper: &[f64]) -> Option<Vec<f64>> {
        self.object.or_fault(self.left(response, hyper), || None)
    }

    fn gradient(&self, response: &[f64], hyper: &[f64]) -> (Vec<f64>, Vec<f64>) {
        // SAFETY: the buffers hold one number an output and an unknown.
        let call = |to, beside| unsafe { self.object.gradient(response, hyper, to, beside) };
        let density = || self.log_likelihood(response, hyper);
        slopes(&self.object, (response.len(), hyper.len()), call, density)
    }

    fn is_cheap(&self) -> bool {
        // SAFETY: there is a place for one mark.
        let cheap = mark(false, |to| unsafe { self.object.is_cheap(to) });
        self.object.or_fault(cheap, || false)
    }

    fn compress(&self, linear: &dyn Linear) -> Option<Box<dyn Compressed>> {
        let reduced = self.object.or_fault(self.reduced(linear), || None);
        reduced.map(|reduced| -> Box<dyn Compressed> { Box::new(reduced) })
    }

    fn predictive(&self, response: &[f64], hyper: &[f64]) -> Vec<VariancePart> {
        self.object.or_fault(self.parts(response, hyper), Vec::new)
    }

    fn simulate(&self, response: &[f64], hyper: &[f64], stream: &Stream) -> Vec<Measurements> {
        let made = self.simulated(response, hyper, stream);
        vec![self.object.or_fault(made, || self.data.clone())]
    }

    fn sampled_errors(&self, hyper: &[f64]) -> Option<SampledErrors> {
        self.object.or_fault(self.sampled(hyper), || None)
    }

    fn facts(&self) -> Vec<Fact> {
        // SAFETY: nothing is written.
        self.object.or_fault(unsafe { self.object.facts() }.json_if_any(), Vec::new)
    }

    fn failure(&self) -> Option<String> {
        self.object.fault().said().map(str::to_owned)
    }
}
