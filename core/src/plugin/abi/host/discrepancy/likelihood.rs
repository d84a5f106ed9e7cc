//! The likelihoods of libraries' discrepancies.

use super::compressed::LoadedCompressed;
use super::slopes;
use crate::data::{Measurements, Replicate};
use crate::linalg::Matrix;
use crate::math::random::Stream;
use crate::plugin::abi::Refusal;
use crate::plugin::abi::host::object::{Object, numbers_only, shaped};
use crate::plugin::abi::host::plugin::{facts, optional, unknowns};
use crate::plugin::abi::linear::ServedLinear;
use crate::plugin::abi::table::{self, Key, LikelihoodFunctions, Numbers};
use crate::plugin::discrepancy::{Compressed, Likelihood, VariancePart};
use crate::plugin::forward::Linear;
use crate::plugin::{Fact, Hyperparameter};

/// A likelihood that a library computes.
pub(super) struct LoadedLikelihood {
    object: Object<LikelihoodFunctions>,
    hyper: Vec<Hyperparameter>,
    /// The measurements, whose gaps simulated data have.
    data: Measurements,
}

impl LoadedLikelihood {
    pub fn new(object: Object<LikelihoodFunctions>, data: &Measurements) -> Result<Self, Refusal> {
        let (ask, this) = (object.functions.hyperparameters, object.this);
        // SAFETY: the function belongs to the likelihood.
        let reply =
            object.demand("hyperparameters", |a| optional(ask, |f| unsafe { f(this, a) }))?;
        Ok(Self { hyper: unknowns(reply)?, object, data: data.clone() })
    }

    fn values(&self, responses: Numbers, hyper: Numbers) -> Vec<f64> {
        let (ask, this) = (self.object.functions.log_likelihood, self.object.this);
        let values = self.object.densities("log_likelihood", responses.rows, |to, a| {
            // SAFETY: the function belongs to the likelihood; the buffer holds one number a response.
            optional(ask, |f| unsafe { f(this, responses, hyper, to, a) })
        });
        self.object.or_fault(values, || vec![f64::NEG_INFINITY; responses.rows])
    }

    fn parts(&self, response: &[f64], hyper: &[f64]) -> Result<Vec<VariancePart>, Refusal> {
        let (ask, this) = (self.object.functions.predictive, self.object.this);
        let (at, given) = (Numbers::row(response), Numbers::row(hyper));
        // SAFETY: the function belongs to the likelihood.
        let call = |a| optional(ask, |f| unsafe { f(this, at, given, a) });
        let reply = self.object.demand("predictive", call)?;
        let origins: Vec<String> = reply.json()?;
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
        let (ask, this) = (self.object.functions.simulate, self.object.this);
        let (at, given, key) =
            (Numbers::row(response), Numbers::row(hyper), Key { words: stream.key() });
        let outputs = self.data.layout.len();
        let mut values = Matrix::from_fn(self.data.replicates.len(), outputs, |_, _| f64::NAN);
        let to = values.as_mut_slice().as_mut_ptr();
        // SAFETY: the function belongs to the likelihood; the buffer holds `replicates x outputs` numbers.
        self.object
            .demand("simulate", |a| optional(ask, |f| unsafe { f(this, at, given, key, to, a) }))?;
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
        let (ask, this) = (self.object.functions.left_out, self.object.this);
        let (at, given) = (Numbers::row(response), Numbers::row(hyper));
        // SAFETY: the function belongs to the likelihood.
        let call = |a| optional(ask, |f| unsafe { f(this, at, given, a) });
        let Some(reply) = self.object.ask("left_out", call)? else { return Ok(None) };
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

    fn reduced(&self, linear: &dyn Linear) -> Result<Option<LoadedCompressed>, Refusal> {
        let (ask, this) = (self.object.functions.compress, self.object.this);
        let served = ServedLinear::new(linear);
        let (map, null) = (served.table(), std::ptr::null_mut());
        let mut made = table::Compressed { size: 0, compressed: null, functions: std::ptr::null() };
        let to = &raw mut made;
        // SAFETY: the function belongs to the likelihood; map and place are there until it returns.
        let call = |a| optional(ask, |f| unsafe { f(this, &raw const map, to, a) });
        if self.object.ask("compress", call)?.is_none() {
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
        let (ask, this) = (self.object.functions.gradient, self.object.this);
        let (at, given) = (Numbers::row(response), Numbers::row(hyper));
        let call = |to, beside, a| {
            // SAFETY: the function belongs to the likelihood; the buffers hold one number an output and an unknown.
            optional(ask, |f| unsafe { f(this, at, given, to, beside, a) })
        };
        let density = || self.log_likelihood(response, hyper);
        slopes(&self.object, (response.len(), hyper.len()), call, density)
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

    fn facts(&self) -> Vec<Fact> {
        let (ask, this) = (self.object.functions.facts, self.object.this);
        // SAFETY: the function belongs to the likelihood.
        let reply = self.object.ask("facts", |a| optional(ask, |f| unsafe { f(this, a) }));
        self.object.or_fault(reply.and_then(facts), Vec::new)
    }

    fn failure(&self) -> Option<String> {
        self.object.fault().said().map(str::to_owned)
    }
}
