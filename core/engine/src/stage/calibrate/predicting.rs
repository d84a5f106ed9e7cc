//! Predictions of new data by a discrepancy that samples the common errors.

use lacuna::data::Measurements;
use lacuna::data::measurements::Summary;
use lacuna::math::random::Stream;
use lacuna::plugin::discrepancy::{CommonError, ErrorPath, Hyperparameter, VariancePart};
use lacuna::plugin::{Fact, Likelihood};
use lacuna::run::Stop;

/// A discrepancy without common errors, to whose predictions the errors are added. Some of the unknowns are not used:
/// the weights of the errors, which were sampled at another size.
pub(super) struct Added {
    alone: Box<dyn Likelihood>,
    errors: Vec<CommonError>,
    unknowns: Vec<Hyperparameter>,
    /// For each unknown of the discrepancy alone, its index among all unknowns.
    own: Vec<usize>,
}

impl Added {
    /// Combines the discrepancy alone, the errors expected in new data, and the unknowns that were sampled.
    pub fn new(
        alone: Box<dyn Likelihood>,
        errors: Vec<CommonError>,
        sampled: &[Hyperparameter],
    ) -> Result<Self, Stop> {
        let place = |own: &Hyperparameter| {
            let found = sampled.iter().position(|h| h.name == own.name);
            found.ok_or_else(|| {
                let text = "has an unknown only where there are no common errors";
                Stop::new(format!("the discrepancy {text}: `{}`", own.name))
            })
        };
        let own = alone.hyperparameters().iter().map(place).collect::<Result<_, _>>()?;
        Ok(Self { alone, errors, unknowns: sampled.to_vec(), own })
    }

    fn own(&self, hyper: &[f64]) -> Vec<f64> {
        self.own.iter().map(|&k| hyper[k]).collect()
    }
}

impl Likelihood for Added {
    fn hyperparameters(&self) -> &[Hyperparameter] {
        &self.unknowns
    }

    /// Log-likelihood of data without common errors.
    fn log_likelihood(&self, response: &[f64], hyper: &[f64]) -> f64 {
        self.alone.log_likelihood(response, &self.own(hyper))
    }

    fn gradient(&self, response: &[f64], hyper: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let (by_response, by_own) = self.alone.gradient(response, &self.own(hyper));
        let mut by_hyper = vec![0.0; hyper.len()];
        for (&k, g) in self.own.iter().zip(by_own) {
            by_hyper[k] = g;
        }
        (by_response, by_hyper)
    }

    fn predictive(&self, response: &[f64], hyper: &[f64]) -> Vec<VariancePart> {
        let mut parts = self.alone.predictive(response, &self.own(hyper));
        parts.extend(self.errors.iter().filter(|error| error.predictive).map(CommonError::part));
        parts
    }

    fn errors(&self, response: &[f64], hyper: &[f64], stream: &Stream) -> Vec<ErrorPath> {
        let mut paths = self.alone.errors(response, &self.own(hyper), stream);
        let stream = stream.named("common");
        let common = self.errors.iter().filter(|error| error.predictive).enumerate();
        paths.extend(common.map(|(k, error)| error.draw(&stream.at(k as u64))));
        paths
    }

    fn simulate(&self, response: &[f64], hyper: &[f64], stream: &Stream) -> Vec<Measurements> {
        let mean = CommonError::added(&self.errors, response, stream);
        self.alone.simulate(&mean, &self.own(hyper), stream)
    }

    fn simulate_summaries(
        &self,
        response: &[f64],
        hyper: &[f64],
        stream: &Stream,
    ) -> Option<Vec<Vec<Summary>>> {
        let mean = CommonError::added(&self.errors, response, stream);
        self.alone.simulate_summaries(&mean, &self.own(hyper), stream)
    }

    fn facts(&self) -> Vec<Fact> {
        self.alone.facts()
    }

    fn failure(&self) -> Option<String> {
        self.alone.failure()
    }
}
