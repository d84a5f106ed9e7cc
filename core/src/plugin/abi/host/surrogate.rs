//! Surrogates of libraries.

use std::ffi::c_void;
use std::sync::{Arc, OnceLock};

use super::Plugin;
use super::object::{Object, finite_only, numbers_only, shaped};
use super::plugin::{facts, optional};
use crate::linalg::Matrix;
use crate::math::random::Stream;
use crate::plugin::abi::Refusal;
use crate::plugin::abi::guard::{guard_number, object};
use crate::plugin::abi::linear::LinearView;
use crate::plugin::abi::table::{
    self, EmulatorFunctions, Key, Numbers, ProgressFunctions, SurrogateFunctions, Text,
};
use crate::plugin::abi::wire::TrainingAbout;
use crate::plugin::forward::{Forward, Linear};
use crate::plugin::surrogate::{Emulator, FitError, Sensitivity, Summand, Surrogate, Training};
use crate::plugin::{Fact, Fault};
use crate::run::{Progress, Stop};

static PROGRESS: ProgressFunctions =
    ProgressFunctions { size: size_of::<ProgressFunctions>(), add: Some(add), warn: Some(warn) };

unsafe extern "C" fn add(progress: *mut c_void, units: u64) {
    // SAFETY: the progress of the fit that is under way.
    guard_number((), || unsafe { object::<Progress<'_>>(progress) }.add(units));
}

unsafe extern "C" fn warn(progress: *mut c_void, text: Text) {
    // SAFETY: as in `add`; the text is there for the time of the call.
    guard_number((), || unsafe { object::<Progress<'_>>(progress).warn(&text.string()) });
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
        let told = table::Progress {
            size: size_of::<table::Progress>(),
            progress: std::ptr::from_ref(progress).cast_mut().cast(),
            functions: &raw const PROGRESS,
        };
        let (mut made, key) = (nothing(), Key { words: stream.key() });
        let (ask, this, to) = (self.object.functions.fit, self.object.this, &raw mut made);
        // SAFETY: the function belongs to the plugin; all that it is given is there until it returns.
        let call = |a| {
            optional(ask, |f| unsafe { f(this, &raw const training, key, &raw const told, to, a) })
        };
        self.object.demand("fit", call)?;
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
        let (ask, this, to) = (self.object.functions.load, self.object.this, &raw mut made);
        // SAFETY: as in `fitted`.
        self.object.demand("load", |a| {
            optional(ask, |f| unsafe { f(this, Text::of_bytes(bytes), to, a) })
        })?;
        LoadedEmulator::new(&made, self.object.fault().clone())?.judged()
    }

    fn summed(
        &self,
        parts: &[Summand<'_>],
        offset: &[f64],
    ) -> Result<Option<LoadedEmulator>, Refusal> {
        let Some(ask) = self.object.functions.sum else { return Ok(None) };
        let part = |part: &Summand<'_>| table::Summand {
            bytes: Text::of_bytes(part.bytes),
            weights: Numbers::row(part.weights),
        };
        let handed: Vec<table::Summand> = parts.iter().map(part).collect();
        let (mut made, this) = (nothing(), self.object.this);
        let (first, count, added, to) =
            (handed.as_ptr(), handed.len(), Numbers::row(offset), &raw mut made);
        // SAFETY: as in `fitted`.
        let call = |a| unsafe { ask(this, first, count, added, to, a) };
        if self.object.ask("sum", call)?.is_none() {
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
        let (ask, this) = (object.functions.fit_error, object.this);
        // SAFETY: the function belongs to the emulator.
        let reply = object.demand("fit_error", |a| optional(ask, |f| unsafe { f(this, a) }))?;
        let [relative, residuals] = reply.matrices()?;
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
        let Some(ask) = self.object.functions.mean_and_jacobian else { return Ok(None) };
        let (this, at, mut mean) =
            (self.object.this, Numbers::row(point), vec![f64::NAN; self.outputs]);
        let (first, columns) =
            parameters.map_or((std::ptr::null(), point.len()), |some| (some.as_ptr(), some.len()));
        let what = "mean_and_jacobian";
        let means = mean.as_mut_ptr();
        let slopes = self.object.ask_numbers(what, self.outputs * columns, |to, a| {
            // SAFETY: the function belongs to the emulator; the buffers hold `outputs` and `outputs x parameters` numbers,
            // and the parameters are there until it returns.
            unsafe { ask(this, at, first, columns, means, to, a) }
        })?;
        let Some(slopes) = slopes else { return Ok(None) };
        numbers_only(what, &mean)?;
        Ok(Some((mean, Matrix::from_vec(self.outputs, columns, slopes))))
    }

    fn view(&self) -> Result<Option<LinearView>, Refusal> {
        let Some(ask) = self.object.functions.linear else { return Ok(None) };
        let null = Numbers { values: std::ptr::null(), rows: 0, columns: 0 };
        let mut map = table::Linear {
            size: 0,
            map: std::ptr::null_mut(),
            functions: std::ptr::null(),
            coefficients: null,
        };
        let to = &raw mut map;
        // SAFETY: the function belongs to the emulator, and the place is there until it returns.
        if self.object.ask("linear", |a| unsafe { ask(self.object.this, to, a) })?.is_none() {
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
        let (ask, this, at) = (self.object.functions.mean, self.object.this, Numbers::of(points));
        let values = self.object.numbers("mean", points.rows() * self.outputs, |to, a| {
            // SAFETY: the function belongs to the emulator; the buffer holds `points x outputs` numbers.
            optional(ask, |f| unsafe { f(this, at, to, a) })
        });
        let matrix = values.map(|values| Matrix::from_vec(points.rows(), self.outputs, values));
        self.object.or_fault(matrix, || self.nowhere(points.rows()))
    }

    fn variance(&self, points: &Matrix) -> Option<Matrix> {
        let (ask, this, at) =
            (self.object.functions.variance?, self.object.this, Numbers::of(points));
        let values = self.object.ask_numbers("variance", points.rows() * self.outputs, |to, a| {
            // SAFETY: as in `mean`.
            unsafe { ask(this, at, to, a) }
        });
        let values = self.object.or_fault(values, || None)?;
        Some(Matrix::from_vec(points.rows(), self.outputs, values))
    }

    fn jacobian(&self, point: &[f64]) -> Matrix {
        let (ask, this, at) =
            (self.object.functions.jacobian, self.object.this, Numbers::row(point));
        let values = self.object.numbers("jacobian", point.len() * self.outputs, |to, a| {
            // SAFETY: the function belongs to the emulator; the buffer holds `outputs x parameters` numbers.
            optional(ask, |f| unsafe { f(this, at, to, a) })
        });
        let matrix = values.map(|values| Matrix::from_vec(self.outputs, point.len(), values));
        self.object.or_fault(matrix, || Matrix::zeros(self.outputs, point.len()))
    }

    fn mean_and_jacobian(&self, point: &[f64]) -> (Vec<f64>, Matrix) {
        self.object.or_fault(self.both(point, None), || None).unwrap_or_else(|| {
            let mean = self.mean(&Matrix::from_vec(1, point.len(), point.to_vec()));
            (mean.into_vec(), self.jacobian(point))
        })
    }

    fn mean_and_jacobian_by(&self, point: &[f64], parameters: &[usize]) -> (Vec<f64>, Matrix) {
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
        let (ask, this) = (self.object.functions.sensitivity?, self.object.this);
        // SAFETY: the function belongs to the emulator.
        let reply = self.object.ask("sensitivity", |a| unsafe { ask(this, a) });
        let read = reply.and_then(|reply| reply.map(|reply| reply.json()).transpose());
        self.object.or_fault(read, || None)
    }

    fn fit_error(&self) -> &FitError {
        &self.fit_error
    }

    fn facts(&self) -> Vec<Fact> {
        let (ask, this) = (self.object.functions.facts, self.object.this);
        // SAFETY: the function belongs to the emulator.
        let reply = self.object.ask("facts", |a| optional(ask, |f| unsafe { f(this, a) }));
        self.object.or_fault(reply.and_then(facts), Vec::new)
    }

    fn save(&self) -> Result<Vec<u8>, Stop> {
        let (ask, this) = (self.object.functions.save, self.object.this);
        // SAFETY: the function belongs to the emulator.
        let reply = self.object.demand("save", |a| optional(ask, |f| unsafe { f(this, a) }));
        Ok(self.object.or_stop(reply)?.text)
    }
}
