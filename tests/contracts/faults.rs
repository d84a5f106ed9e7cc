//! The suites detect faults: a correct plugin of the program with one planted fault does not pass.

use std::path::{Path, PathBuf};

use lacuna::data::{Layout, Measurements};
use lacuna::math::random::Stream;
use lacuna::plugin::discrepancy::{Known, VariancePart};
use lacuna::plugin::model::{Call, EvalError, Response, Signature};
use lacuna::plugin::reader::{Contents, ReadError};
use lacuna::plugin::surrogate::{FitError, Training};
use lacuna::plugin::{
    Component, Context, Discrepancy, Emulator, Fact, Forward, Hyperparameter, Likelihood, Model,
    Reader, Surrogate, registry,
};
use lacuna::run::{Progress, Stop};
use lacuna_contract::Sample;
use lacuna_linalg::Matrix;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Fault {
    Derivative,
    Variance,
    Gaps,
    Support,
    Loss,
    Threads,
    Bytes,
    NotFinite,
    Truncated,
    Panic,
}

/// Requires that one of the violations contains this text.
fn found(breaches: Result<(), Vec<String>>, fault: Fault, expected: &str) {
    let breaches = breaches.err().unwrap_or_default();
    assert!(breaches.iter().any(|b| b.contains(expected)), "{fault:?}, {expected}: {breaches:?}");
}

struct Faulty<T: ?Sized> {
    fault: Fault,
    sound: Box<T>,
}

impl<T: ?Sized + Send + Sync> Component for Faulty<T> {}

impl Discrepancy for Faulty<dyn Discrepancy> {
    fn likelihood(&self, known: &Known<'_>) -> Result<Box<dyn Likelihood>, Stop> {
        let sound = self.sound.likelihood(known)?;
        Ok(Box::new(Faulty { fault: self.fault, sound }))
    }
}

impl Likelihood for Faulty<dyn Likelihood> {
    fn hyperparameters(&self) -> &[Hyperparameter] {
        self.sound.hyperparameters()
    }
    fn log_likelihood(&self, response: &[f64], hyper: &[f64]) -> f64 {
        if self.fault == Fault::Support && hyper[0].is_nan() {
            return 0.0;
        }
        self.sound.log_likelihood(response, hyper)
    }
    fn gradient(&self, response: &[f64], hyper: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let (by_response, mut by_hyper) = self.sound.gradient(response, hyper);
        if self.fault == Fault::Derivative {
            by_hyper[0] *= 1.001;
        }
        (by_response, by_hyper)
    }
    fn predictive(&self, response: &[f64], hyper: &[f64]) -> Vec<VariancePart> {
        let mut parts = self.sound.predictive(response, hyper);
        if self.fault == Fault::Variance {
            parts.iter_mut().flat_map(|p| &mut p.variance).for_each(|v| *v *= 1.5);
        }
        parts
    }
    fn simulate(&self, response: &[f64], hyper: &[f64], stream: &Stream) -> Vec<Measurements> {
        let mut data = self.sound.simulate(response, hyper, stream);
        if self.fault == Fault::Gaps {
            data[0].replicates[1].values.fill(Some(1.0));
        }
        data
    }
}

#[test]
fn faults_of_discrepancies_are_found() {
    for (fault, expected) in [
        (Fault::Derivative, "the derivative by hyperparameter 1 is"),
        (Fault::Variance, "predicted"),
        (Fault::Gaps, "simulated data have other gaps"),
        (Fault::Support, "`variance` = NaN"),
    ] {
        let options = "variance = { half_normal = 1.0 }";
        let sound = registry::from_text::<dyn Discrepancy>("gaussian", options).unwrap().plugin;
        found(lacuna_contract::discrepancy("faulty", &Faulty { fault, sound }), fault, expected);
    }
}

impl Surrogate for Faulty<dyn Surrogate> {
    fn fit(
        &self,
        training: &Training<'_>,
        stream: &Stream,
        progress: &Progress<'_>,
    ) -> Result<Box<dyn Emulator>, Stop> {
        let sound = self.sound.fit(training, stream, progress)?;
        Ok(Box::new(Faulty { fault: self.fault, sound }))
    }
    fn load(&self, bytes: &[u8]) -> Result<Box<dyn Emulator>, Stop> {
        if self.fault == Fault::Panic {
            assert!(bytes.len() > 10, "a planted panic");
        }
        let sound = self.sound.load(bytes)?;
        Ok(Box::new(Lossy(Faulty { fault: self.fault, sound })))
    }
}

impl Forward for Faulty<dyn Emulator> {
    fn dimension(&self) -> usize {
        self.sound.dimension()
    }

    fn outputs(&self) -> usize {
        self.sound.outputs()
    }

    fn mean(&self, points: &Matrix) -> Matrix {
        self.sound.mean(points)
    }

    fn jacobian(&self, point: &[f64]) -> Matrix {
        let mut jacobian = self.sound.jacobian(point);
        if self.fault == Fault::Derivative {
            jacobian[(2, 1)] *= 1.01;
        }
        jacobian
    }
}

impl Emulator for Faulty<dyn Emulator> {
    fn fit_error(&self) -> &FitError {
        self.sound.fit_error()
    }

    fn facts(&self) -> Vec<Fact> {
        self.sound.facts()
    }

    fn save(&self) -> Result<Vec<u8>, Stop> {
        let mut bytes = self.sound.save()?;
        if self.fault == Fault::Threads && rayon::current_num_threads() == 3 {
            bytes.push(0);
        }
        Ok(bytes)
    }
}

/// An emulator that differs slightly from the saved one after loading.
struct Lossy(Faulty<dyn Emulator>);

impl Forward for Lossy {
    fn dimension(&self) -> usize {
        self.0.dimension()
    }

    fn outputs(&self) -> usize {
        self.0.outputs()
    }

    fn mean(&self, points: &Matrix) -> Matrix {
        let mut mean = self.0.mean(points);
        if self.0.fault == Fault::Loss {
            mean[(0, 0)] *= 1.0 + f64::EPSILON;
        }
        mean
    }

    fn jacobian(&self, point: &[f64]) -> Matrix {
        self.0.jacobian(point)
    }
}

impl Emulator for Lossy {
    fn fit_error(&self) -> &FitError {
        self.0.fit_error()
    }

    fn facts(&self) -> Vec<Fact> {
        self.0.facts()
    }

    fn save(&self) -> Result<Vec<u8>, Stop> {
        self.0.save()
    }
}

#[test]
fn faults_of_surrogates_are_found() {
    for (fault, expected) in [
        (Fault::Derivative, "the derivative by parameter 2 of output 3"),
        (Fault::Loss, "it is another one after reading"),
        (Fault::Threads, "one and three threads differ"),
        (Fault::Panic, "0 of its bytes makes it panic"),
    ] {
        let sound = registry::from_text::<dyn Surrogate>("polynomial_chaos", "degree = 4");
        let sound = sound.unwrap().plugin;
        found(lacuna_contract::surrogate("faulty", &Faulty { fault, sound }), fault, expected);
    }
}

impl Model for Faulty<dyn Model> {
    fn signature(&self, context: &Context<'_>) -> Signature {
        let mut signature = self.sound.signature(context);
        if self.fault == Fault::Support {
            signature.inputs[0].default = Some(-1.0);
        }
        signature
    }
    fn predict(&self, call: &Call<'_>) -> Result<Response, EvalError> {
        let mut response = self.sound.predict(call)?;
        match self.fault {
            Fault::NotFinite => response.values[3] = f64::NAN,
            Fault::Threads => response.values[0] += rayon::current_num_threads() as f64,
            _ => {}
        }
        Ok(response)
    }
    fn write(
        &self,
        run: &str,
        call: &Call<'_>,
        response: &Response,
        directory: &Path,
    ) -> Result<Option<String>, EvalError> {
        let file = self.sound.write(run, call, response, directory)?;
        Ok(file.map(|file| if self.fault == Fault::Bytes { "other".into() } else { file }))
    }
}

#[test]
fn faults_of_models_are_found() {
    for (fault, expected) in [
        (Fault::NotFinite, "NaN at sensor `B`, time 0.00004 s"),
        (Fault::Threads, "one and three threads differ"),
        (Fault::Bytes, "`other`: No such file"),
        (Fault::Support, "the default or the range of `density` is not sound"),
    ] {
        let options = "numerics = { mesh = [4, 12] }";
        let sound = registry::from_text::<dyn Model>("mercury_target", options).unwrap().plugin;
        let scratch = tempfile::tempdir().unwrap();
        let layout = Layout::number("none");
        let context = Context::new(scratch.path(), &[], &layout);
        let faulty = Faulty { fault, sound };
        found(lacuna_contract::model("faulty", &faulty, &context, scratch.path()), fault, expected);
    }
}

impl Reader for Faulty<dyn Reader> {
    fn recognises(&self, path: &Path, head: &[u8]) -> bool {
        self.fault == Fault::Support || self.sound.recognises(path, head)
    }
    fn inspect(&self, path: &Path) -> Result<Contents, ReadError> {
        self.sound.inspect(path)
    }
    fn names_files(&self) -> bool {
        self.sound.names_files()
    }
    fn response(&self, path: &Path, layout: &Layout) -> Result<Vec<f64>, ReadError> {
        let length = std::fs::metadata(path).map_or(1, |m| m.len());
        assert!(self.fault != Fault::Panic || length > 0, "a planted panic");
        match self.sound.response(path, layout) {
            Err(_) if self.fault == Fault::Truncated => Ok(vec![0.0; layout.len()]),
            Ok(values) if self.fault == Fault::Loss => {
                Ok(values.iter().map(|y| f64::from(*y as f32)).collect())
            }
            outcome => outcome,
        }
    }
    fn files(&self, directory: &Path, scenario: Option<&str>) -> Vec<PathBuf> {
        self.sound.files(directory, scenario)
    }
}

#[test]
fn faults_of_readers_are_found() {
    let folder = tempfile::tempdir().unwrap();
    let layout = super::layout();
    let values = super::strain();
    let response = Response { values: values.clone(), valid: true, facts: Vec::new() };
    let file = lacuna_run::write_response(folder.path(), "sound", &layout, &response).unwrap();
    let sample = Sample { file: folder.path().join(file), layout, values, tolerance: 0.0 };
    for (fault, expected) in [
        (Fault::Support, "no bytes are recognised"),
        (Fault::Panic, "an empty file makes it panic"),
        (Fault::Truncated, "is accepted"),
        (Fault::Loss, "the response at sensor `B`, time 0.00001 s is"),
    ] {
        let sound = registry::from_text::<dyn Reader>("netcdf", "").unwrap().plugin;
        let scratch = tempfile::tempdir().unwrap();
        let breaches =
            lacuna_contract::reader("faulty", &Faulty { fault, sound }, &sample, scratch.path());
        found(breaches, fault, expected);
    }
}
