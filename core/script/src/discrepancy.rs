//! Discrepancies in Python.

use lacuna::data::{Layout, Measurements, Replicate};
use lacuna::math::random::Stream;
use lacuna::matrix::Matrix;
use lacuna::plugin::Hyperparameter;
use lacuna::plugin::discrepancy::{
    CommonError, Discrepancy, ErrorOrigin, Known, Likelihood, VariancePart,
};
use lacuna::run::Stop;
use lacuna_abi::Refusal;
use lacuna_abi::check::{densities_only, numbers_only, shaped};
use serde_json::{Value as Json, json};

use crate::object::{Call, Object, Plugin, answer, matrices, matrix, row, unknowns};

/// The likelihood of fixed measurements.
struct Made {
    object: Object,
    hyper: Vec<Hyperparameter>,
    names: Vec<String>,
    /// Measurements, whose gaps simulated data have.
    data: Measurements,
    exact: bool,
}

/// Rows of numbers, NaN where there are none.
fn rows<'a>(
    replicates: &'a [Replicate],
    outputs: usize,
    of: impl Fn(&'a Replicate) -> Vec<f64>,
) -> Result<Matrix, Refusal> {
    let mut all = Matrix::zeros(0, outputs);
    for replicate in replicates {
        let row = of(replicate);
        if row.len() != outputs {
            let (name, found) = (&replicate.name, row.len());
            let message =
                format!("replicate `{name}` has {found} values, and the response {outputs}");
            return Err(Refusal::stop(message));
        }
        all.push_row(&row);
    }
    Ok(all)
}

/// A common error without its factor.
fn common(error: &CommonError) -> Json {
    json!({ "origin": error.origin.as_str(), "predictive": error.predictive })
}

/// Refuses data without a value, or with one that is no number.
fn sound(data: &Measurements) -> Result<(), Refusal> {
    if data.count() == 0 {
        return Err(Refusal::stop("there are no measured values"));
    }
    let odd = |replicate: &&Replicate| replicate.values.iter().flatten().any(|y| !y.is_finite());
    match data.replicates.iter().find(odd) {
        Some(replicate) => {
            let name = &replicate.name;
            Err(Refusal::stop(format!("replicate `{name}` has a value that is not finite")))
        }
        None => Ok(()),
    }
}

impl Plugin {
    fn made(&self, known: &Known<'_>) -> Result<Made, Refusal> {
        let (data, outputs) = (known.data, known.data.layout.len());
        sound(data)?;
        for error in known.common {
            shaped("common errors", &error.factor, outputs, error.factor.columns())?;
        }
        let values = |r: &Replicate| r.values.iter().map(|y| y.unwrap_or(f64::NAN)).collect();
        let values = rows(&data.replicates, outputs, values)?;
        let states = data.replicates.iter().any(|replicate| replicate.sd.is_some());
        let sd = |r: &Replicate| r.sd.clone().unwrap_or_else(|| vec![f64::NAN; outputs]);
        let sd = rows(if states { &data.replicates } else { &[] }, outputs, sd)?;
        let covariance = data.covariance.clone().unwrap_or_else(|| Matrix::zeros(0, outputs));
        let mut given = vec![&values, &sd, &covariance];
        given.extend(known.common.iter().map(|error| &*error.factor));
        let names: Vec<&String> = data.replicates.iter().map(|replicate| &replicate.name).collect();
        let common: Vec<_> = known.common.iter().map(common).collect();
        let about = json!({ "layout": data.layout, "replicates": names, "common": common });
        let call = Call::new("likelihood", &given).about(about);
        let (object, made) = self.0.make(&call)?;
        let hyper = unknowns(&made)?;
        let names = hyper.iter().map(|own| own.name.clone()).collect();
        let exact = self.0.has("gradient");
        Ok(Made { object, hyper, names, data: data.clone(), exact })
    }
}

impl Discrepancy for Plugin {
    fn likelihood(&self, known: &Known<'_>) -> Result<Box<dyn Likelihood>, Stop> {
        Ok(Box::new(self.0.or_stop(self.made(known))?))
    }

    fn takes_stated_noise(&self) -> bool {
        self.0.has("takes_stated_noise")
    }
}

impl Made {
    fn call<'a>(
        &'a self,
        what: &'static str,
        given: &'a [&'a Matrix],
    ) -> Result<Call<'a>, Refusal> {
        let known = self.object.known(&self.names, &Layout::number("likelihood"), None)?;
        Ok(Call { known, ..Call::new(what, given) })
    }

    /// Densities of points inside the supports of the unknowns' priors; others have none, and are not asked for.
    fn densities(&self, responses: &Matrix, hyper: &Matrix) -> Result<Vec<f64>, Refusal> {
        let inside: Vec<usize> = (0..hyper.rows()).filter(|&i| self.allows(hyper.row(i))).collect();
        if inside.len() < hyper.rows() {
            let mut all = vec![f64::NEG_INFINITY; hyper.rows()];
            if !inside.is_empty() {
                let (responses, hyper) =
                    (responses.select_rows(&inside), hyper.select_rows(&inside));
                let values = self.asked(&responses, &hyper)?;
                inside.iter().zip(values).for_each(|(&i, value)| all[i] = value);
            }
            return Ok(all);
        }
        self.asked(responses, hyper)
    }

    fn allows(&self, hyper: &[f64]) -> bool {
        self.hyper.iter().zip(hyper).all(|(own, x)| own.prior.log_density(*x) > f64::NEG_INFINITY)
    }

    fn asked(&self, responses: &Matrix, hyper: &Matrix) -> Result<Vec<f64>, Refusal> {
        let given = [responses, hyper];
        let message = self.object.ask(&self.call("log_likelihood", &given)?)?;
        let values = matrix("log_likelihood", message, 1, responses.rows())?.into_vec();
        densities_only("log_likelihood", &values)?;
        Ok(values)
    }

    fn slopes(&self, response: &[f64], hyper: &[f64]) -> Result<(Vec<f64>, Vec<f64>), Refusal> {
        if !self.exact {
            return self.differences(response, hyper);
        }
        let (response, hyper) = (row(response), row(hyper));
        let message = self.object.ask(&self.call("gradient", &[&response, &hyper])?)?;
        let [by_response, by_hyper] = matrices(message)?;
        shaped("gradient", &by_response, 1, response.columns())?;
        shaped("gradient", &by_hyper, by_hyper.rows(), hyper.columns())?;
        numbers_only("gradient", by_response.as_slice())?;
        numbers_only("gradient", by_hyper.as_slice())?;
        Ok((by_response.into_vec(), by_hyper.into_vec()))
    }

    /// Central differences, whose steps follow the scatter of the measurements and the size of the unknowns. All points of a
    /// gradient are one call.
    fn differences(
        &self,
        response: &[f64],
        hyper: &[f64],
    ) -> Result<(Vec<f64>, Vec<f64>), Refusal> {
        let outputs = response.len();
        let scale = (response.iter().map(|y| y * y).sum::<f64>() / outputs.max(1) as f64).sqrt();
        let step = |x: f64, scale: f64| STEP * x.abs().max(scale).max(f64::MIN_POSITIVE / STEP);
        let mut responses = Matrix::zeros(0, outputs);
        let mut unknowns = Matrix::zeros(0, hyper.len());
        let mut steps = Vec::new();
        for i in 0..outputs + hyper.len() {
            let (mut y, mut u) = (response.to_vec(), hyper.to_vec());
            let (place, h) = match i.checked_sub(outputs) {
                None => (&mut y[i], step(response[i], scale)),
                Some(j) => (&mut u[j], step(hyper[j], 0.0)),
            };
            let at = *place;
            for side in [at + h, at - h] {
                match i.checked_sub(outputs) {
                    None => y[i] = side,
                    Some(j) => u[j] = side,
                }
                responses.push_row(&y);
                unknowns.push_row(&u);
            }
            steps.push((at + h) - (at - h));
        }
        let values = self.densities(&responses, &unknowns)?;
        let slope = |(pair, step): (&[f64], &f64)| (pair[0] - pair[1]) / step;
        let mut slopes: Vec<f64> = values.chunks(2).zip(&steps).map(slope).collect();
        // Outside the support of the density there are no slopes.
        slopes.iter_mut().filter(|slope| !slope.is_finite()).for_each(|slope| *slope = 0.0);
        let by_hyper = slopes.split_off(outputs);
        Ok((slopes, by_hyper))
    }

    fn parts(&self, response: &[f64], hyper: &[f64]) -> Result<Vec<VariancePart>, Refusal> {
        let (response, hyper) = (row(response), row(hyper));
        let message = self.object.ask(&self.call("predictive", &[&response, &hyper])?)?;
        let origins: Vec<ErrorOrigin> = answer(&message)?;
        let variances = matrix("variance", message, origins.len(), response.columns())?;
        if let Some(x) = variances.as_slice().iter().find(|x| **x < 0.0) {
            return Err(Refusal::stop(format!("`variance` gives {x}")));
        }
        let part = |(origin, row): (ErrorOrigin, &[f64])| {
            let variance = row.to_vec();
            VariancePart { origin, variance }
        };
        Ok(origins.into_iter().zip(variances.iter_rows()).map(part).collect())
    }

    fn simulated(
        &self,
        response: &[f64],
        hyper: &[f64],
        stream: &Stream,
    ) -> Result<Measurements, Refusal> {
        let (count, outputs) = (self.data.replicates.len(), response.len());
        let (response, hyper) = (row(response), row(hyper));
        let given = [&response, &hyper];
        let call = self.call("simulate", &given)?.about(json!({ "key": stream.key() }));
        let values = matrix("simulate", self.object.ask(&call)?, count, outputs)?;
        let new = |(replicate, row): (&Replicate, &[f64])| {
            let value = |(old, &new): (&Option<f64>, &f64)| old.map(|_| new);
            let values = replicate.values.iter().zip(row).map(value).collect();
            Replicate { values, ..replicate.clone() }
        };
        let replicates = self.data.replicates.iter().zip(values.iter_rows()).map(new).collect();
        Ok(self.data.with_replicates(replicates))
    }
}

/// Step of the differences beside the size of what is stepped: the cube root of the rounding error.
const STEP: f64 = 6e-6;

impl Likelihood for Made {
    fn hyperparameters(&self) -> &[Hyperparameter] {
        &self.hyper
    }

    fn log_likelihood(&self, response: &[f64], hyper: &[f64]) -> f64 {
        self.log_likelihoods(&row(response), &row(hyper))[0]
    }

    fn log_likelihoods(&self, responses: &Matrix, hyper: &Matrix) -> Vec<f64> {
        let values = self.densities(responses, hyper);
        self.object.or_fault(values, || vec![f64::NEG_INFINITY; responses.rows()])
    }

    fn gradient(&self, response: &[f64], hyper: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let nothing = || (vec![0.0; response.len()], vec![0.0; hyper.len()]);
        self.object.or_fault(self.slopes(response, hyper), nothing)
    }

    fn predictive(&self, response: &[f64], hyper: &[f64]) -> Vec<VariancePart> {
        self.object.or_fault(self.parts(response, hyper), Vec::new)
    }

    fn simulate(&self, response: &[f64], hyper: &[f64], stream: &Stream) -> Vec<Measurements> {
        let made = self.simulated(response, hyper, stream);
        vec![self.object.or_fault(made, || self.data.clone())]
    }

    fn failure(&self) -> Option<String> {
        self.object.fault().said().map(str::to_owned)
    }
}
