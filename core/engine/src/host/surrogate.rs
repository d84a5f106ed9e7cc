//! Surrogates of libraries.

use std::sync::{Arc, OnceLock};

use lacuna::math::random::Stream;
use lacuna::plugin::Fact;
use lacuna::plugin::forward::{Forward, Linear, Wanted};
use lacuna::plugin::surrogate::{Emulator, FitError, Sensitivity, Summand, Surrogate, Training};
use lacuna::run::{Fault, Progress, Stop};
use lacuna_abi::check::{finite_only, numbers_only, shaped};
use lacuna_abi::linear::LinearView;
use lacuna_abi::object::{numbers, numbers_if_any};
use lacuna_abi::table::{
    self, EmulatorFunctions, Numbers, ProgressFunctions, ServeProgress, SurrogateFunctions, Text,
};
use lacuna_abi::wire::TrainingAbout;
use lacuna_abi::{Object, Refusal};
use lacuna_linalg::Matrix;

use super::Plugin;

/// The progress of a fit, for the library to tell.
struct Told<'a>(&'a Progress<'a>);

static PROGRESS: ProgressFunctions = ProgressFunctions::of::<Told<'static>>();

impl ServeProgress for Told<'_> {
    fn add(&self, units: u64) {
        self.0.add(units);
    }

    fn warn(&self, text: &[u8]) {
        self.0.warn(&String::from_utf8_lossy(text));
    }
}

/// A place for an emulator.
fn nothing() -> table::Emulator {
    table::Emulator {
        size: 0,
        emulator: std::ptr::null_mut(),
        functions: std::ptr::null(),
        dimension: 0,
        outputs: 0,
    }
}

impl Plugin<SurrogateFunctions> {
    fn fitted(
        &self,
        runs: &Training<'_>,
        stream: &Stream,
        progress: &Progress<'_>,
    ) -> Result<LoadedEmulator, Refusal> {
        let about =
            TrainingAbout { parameters: runs.parameters.to_vec(), layouts: runs.layouts.clone() };
        let about = serde_json::to_string(&about)?;
        let training = table::Training {
            size: size_of::<table::Training>(),
            about: Text::of(&about),
            points: Numbers::of(runs.points),
            responses: Numbers::of(runs.responses),
        };
        let told = Told(progress);
        let told = table::Progress {
            size: size_of::<table::Progress>(),
            progress: (&raw const told).cast_mut().cast(),
            functions: &raw const PROGRESS,
        };
        let mut made = nothing();
        let (runs_given, told, to) = (&raw const training, &raw const told, &raw mut made);
        // SAFETY: all that is given is there until the call returns.
        unsafe { self.object.fit(runs_given, stream, told, to) }.demand()?;
        let emulator = LoadedEmulator::new(&made, self.object.fault().clone())?.judged()?;
        let (dimension, outputs) = (emulator.dimension, emulator.outputs);
        if (dimension, outputs) != (runs.points.columns(), runs.responses.columns()) {
            return Err(Refusal::stop(format!(
                "`fit` gives an emulator of {dimension} parameters and {outputs} outputs"
            )));
        }
        shaped("fit_error", &emulator.fit_error.residuals, runs.points.rows(), outputs)?;
        Ok(emulator)
    }

    fn loaded(&self, bytes: &[u8]) -> Result<LoadedEmulator, Refusal> {
        let mut made = nothing();
        // SAFETY: there is a place for one emulator.
        unsafe { self.object.load(bytes, &raw mut made) }.demand()?;
        LoadedEmulator::new(&made, self.object.fault().clone())?.judged()
    }

    fn summed(
        &self,
        parts: &[Summand<'_>],
        offset: &[f64],
    ) -> Result<Option<LoadedEmulator>, Refusal> {
        let part = |part: &Summand<'_>| table::Summand {
            bytes: Text::of_bytes(part.bytes),
            weights: Numbers::row(part.weights),
        };
        let handed: Vec<table::Summand> = parts.iter().map(part).collect();
        let mut made = nothing();
        let (first, count, to) = (handed.as_ptr(), handed.len(), &raw mut made);
        // SAFETY: as in `fitted`.
        if unsafe { self.object.sum(first, count, offset, to) }.if_any()?.is_none() {
            return Ok(None);
        }
        let emulator = LoadedEmulator::new(&made, self.object.fault().clone())?;
        if emulator.outputs != offset.len() {
            let (found, outputs) = (emulator.outputs, offset.len());
            let message = format!("`sum` gives an emulator of {found} outputs");
            return Err(Refusal::stop(format!("{message} where {outputs} belong")));
        }
        Ok(Some(emulator))
    }
}

impl Surrogate for Plugin<SurrogateFunctions> {
    fn fit(
        &self,
        training: &Training<'_>,
        stream: &Stream,
        progress: &Progress<'_>,
    ) -> Result<Box<dyn Emulator>, Stop> {
        Ok(Box::new(self.object.or_stop(self.fitted(training, stream, progress))?))
    }

    fn load(&self, bytes: &[u8]) -> Result<Box<dyn Emulator>, Stop> {
        Ok(Box::new(self.object.or_stop(self.loaded(bytes))?))
    }

    fn sum(
        &self,
        parts: &[Summand<'_>],
        offset: &[f64],
    ) -> Result<Option<Box<dyn Emulator>>, Stop> {
        let sum = self.object.or_stop(self.summed(parts, offset))?;
        Ok(sum.map(|sum| -> Box<dyn Emulator> { Box::new(sum) }))
    }
}

/// An emulator that a library evaluates.
struct LoadedEmulator {
    // Before the object, whose map it looks at.
    linear: OnceLock<Option<LinearView>>,
    object: Object<EmulatorFunctions>,
    dimension: usize,
    outputs: usize,
    fit_error: FitError,
}

impl LoadedEmulator {
    /// An emulator whose errors are as it says.
    fn new(made: &table::Emulator, fault: Arc<Fault>) -> Result<Self, Refusal> {
        // SAFETY: whoever made the emulator gave it over with its table, a constant.
        let object = unsafe {
            Object::made("emulator", made.emulator, made.functions, |table| table.destroy, fault)?
        };
        // SAFETY: nothing is written.
        let [relative, residuals] = unsafe { object.fit_error() }.demand()?.matrices()?;
        let (dimension, outputs) = (made.dimension, made.outputs);
        let fit_error = FitError { relative: relative.into_vec(), residuals };
        Ok(Self { linear: OnceLock::new(), object, dimension, outputs, fit_error })
    }

    /// An emulator whose errors are of the shape of its outputs; else an error.
    fn judged(self) -> Result<Self, Refusal> {
        let FitError { relative, residuals } = &self.fit_error;
        let relative = Matrix::from_vec(1, relative.len(), relative.clone());
        shaped("fit_error", &relative, 1, self.outputs)?;
        shaped("fit_error", residuals, residuals.rows(), self.outputs)?;
        Ok(self)
    }

    /// The means and the derivatives by these parameters, or by all, at a point; `None` where the emulator answers them
    /// one by one only.
    fn both(
        &self,
        point: &[f64],
        parameters: Option<&[usize]>,
    ) -> Result<Option<(Vec<f64>, Matrix)>, Refusal> {
        let mut mean = vec![f64::NAN; self.outputs];
        let (first, columns) =
            parameters.map_or((std::ptr::null(), point.len()), |some| (some.as_ptr(), some.len()));
        let means = mean.as_mut_ptr();
        // SAFETY: the buffers hold `outputs` and `outputs x parameters` numbers; there are so many parameters.
        let call = |to| unsafe { self.object.mean_and_jacobian(point, first, columns, means, to) };
        let slopes = numbers_if_any(self.outputs * columns, call)?;
        let Some(slopes) = slopes else { return Ok(None) };
        numbers_only("mean_and_jacobian", &mean)?;
        Ok(Some((mean, Matrix::from_vec(self.outputs, columns, slopes))))
    }

    fn view(&self) -> Result<Option<LinearView>, Refusal> {
        let null = Numbers { values: std::ptr::null(), rows: 0, columns: 0 };
        let mut map = table::Linear {
            size: 0,
            map: std::ptr::null_mut(),
            functions: std::ptr::null(),
            coefficients: null,
        };
        // SAFETY: there is a place for one map.
        if unsafe { self.object.linear(&raw mut map) }.if_any()?.is_none() {
            return Ok(None);
        }
        // SAFETY: the map lives as long as the emulator, which ends after its view.
        let view = unsafe { LinearView::new(map, self.object.fault().clone())? };
        let coefficients = view.coefficients();
        shaped("linear", coefficients, coefficients.rows(), self.outputs)?;
        finite_only("linear", coefficients.as_slice())?;
        Ok(Some(view))
    }

    fn nowhere(&self, rows: usize) -> Matrix {
        Matrix::from_fn(rows, self.outputs, |_, _| f64::NAN)
    }
}

impl Forward for LoadedEmulator {
    fn dimension(&self) -> usize {
        self.dimension
    }

    fn outputs(&self) -> usize {
        self.outputs
    }

    fn mean(&self, points: &Matrix) -> Matrix {
        let count = points.rows() * self.outputs;
        // SAFETY: the buffer holds `points x outputs` numbers.
        let values = numbers(count, |to| unsafe { self.object.mean(points, to) });
        let matrix = values.map(|values| Matrix::from_vec(points.rows(), self.outputs, values));
        self.object.or_fault(matrix, || self.nowhere(points.rows()))
    }

    fn variance(&self, points: &Matrix) -> Option<Matrix> {
        let count = points.rows() * self.outputs;
        // SAFETY: as in `mean`.
        let values = numbers_if_any(count, |to| unsafe { self.object.variance(points, to) });
        let values = self.object.or_fault(values, || None)?;
        Some(Matrix::from_vec(points.rows(), self.outputs, values))
    }

    fn jacobian(&self, point: &[f64]) -> Matrix {
        let count = point.len() * self.outputs;
        // SAFETY: the buffer holds `outputs x parameters` numbers.
        let values = numbers(count, |to| unsafe { self.object.jacobian(point, to) });
        let matrix = values.map(|values| Matrix::from_vec(self.outputs, point.len(), values));
        self.object.or_fault(matrix, || Matrix::zeros(self.outputs, point.len()))
    }

    fn mean_and_jacobian(&self, point: &[f64]) -> (Vec<f64>, Matrix) {
        self.object.or_fault(self.both(point, None), || None).unwrap_or_else(|| {
            let mean = self.mean(&Matrix::from_vec(1, point.len(), point.to_vec()));
            (mean.into_vec(), self.jacobian(point))
        })
    }

    fn mean_and_jacobian_by(&self, point: &[f64], wanted: Wanted<'_>) -> (Vec<f64>, Matrix) {
        let parameters = wanted.parameters;
        self.object.or_fault(self.both(point, Some(parameters)), || None).unwrap_or_else(|| {
            let (mean, jacobian) = self.mean_and_jacobian(point);
            (mean, jacobian.select_columns(parameters))
        })
    }

    fn linear(&self) -> Option<&dyn Linear> {
        let view = self.linear.get_or_init(|| self.object.or_fault(self.view(), || None));
        view.as_ref().map(|view| -> &dyn Linear { view })
    }

    fn failure(&self) -> Option<String> {
        self.object.fault().said().map(str::to_owned)
    }
}

impl Emulator for LoadedEmulator {
    fn sensitivity(&self) -> Option<Sensitivity> {
        // SAFETY: nothing is written.
        let reply = unsafe { self.object.sensitivity() }.if_any();
        let read = reply.and_then(|reply| reply.map(|reply| reply.json()).transpose());
        self.object.or_fault(read, || None)
    }

    fn fit_error(&self) -> &FitError {
        &self.fit_error
    }

    fn facts(&self) -> Vec<Fact> {
        // SAFETY: nothing is written.
        self.object.or_fault(unsafe { self.object.facts() }.json_if_any(), Vec::new)
    }

    fn save(&self) -> Result<Vec<u8>, Stop> {
        // SAFETY: nothing is written.
        Ok(self.object.or_stop(unsafe { self.object.save() }.demand())?.text)
    }
}
