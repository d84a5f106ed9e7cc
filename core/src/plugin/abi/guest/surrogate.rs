//! Surrogates of a library.

use std::ffi::c_void;
use std::sync::OnceLock;

use super::component::{Authored, Components, Export};
use crate::math::random::Stream;
use crate::plugin::abi::Refusal;
use crate::plugin::abi::guard::{begin, end, fill, guard, object};
use crate::plugin::abi::linear::ServedLinear;
use crate::plugin::abi::table::{
    self, Answer, ComponentFunctions, EmulatorFunctions, Key, Linear, Numbers, ProgressFunctions,
    SurrogateFunctions, Table as _, Text,
};
use crate::plugin::abi::wire::TrainingAbout;
use crate::plugin::forward;
use crate::plugin::surrogate::{Emulator, Summand, Surrogate, Training};
use crate::run::{Observer, Progress};

impl<T: Surrogate + Authored, const REVISION: u32> Export<T, REVISION> for dyn Surrogate {
    const FUNCTIONS: *const c_void = std::ptr::from_ref(Functions::<T>::TABLE).cast();
    const COMPONENT: *const ComponentFunctions = Components::<T, REVISION>::FUNCTIONS;
}

struct Functions<T>(std::marker::PhantomData<T>);

impl<T: Surrogate + Authored> Functions<T> {
    const TABLE: &'static SurrogateFunctions = &SurrogateFunctions {
        size: size_of::<SurrogateFunctions>(),
        fit: Some(fit::<T>),
        load: Some(load::<T>),
        sum: Some(sum::<T>),
    };
}

static EMULATOR: EmulatorFunctions = EmulatorFunctions {
    size: size_of::<EmulatorFunctions>(),
    destroy: Some(end::<Owned>),
    mean: Some(mean),
    jacobian: Some(jacobian),
    fit_error: Some(fit_error),
    save: Some(save),
    variance: Some(variance),
    linear: Some(linear),
    sensitivity: Some(sensitivity),
    facts: Some(facts),
    mean_and_jacobian: Some(mean_and_jacobian),
};

/// Tells the program how far a fit came; it counts units, not totals.
struct Told {
    progress: *mut c_void,
    functions: ProgressFunctions,
    said: std::sync::atomic::AtomicU64,
}

// SAFETY: the functions of a table may be called from any thread.
unsafe impl Sync for Told {}

impl Observer for Told {
    fn begin(&self, _: &str, _: &str, _: u64) {}
    fn advance(&self, done: u64) {
        let before = self.said.fetch_max(done, std::sync::atomic::Ordering::Relaxed);
        if let Some(add) = self.functions.add
            && done > before
        {
            // SAFETY: the progress is there for the time of the fit.
            unsafe { add(self.progress, done - before) }
        }
    }
    fn end(&self, _: &str, _: &str) {}
    fn warn(&self, text: &str) {
        if let Some(warn) = self.functions.warn {
            // SAFETY: as in `advance`.
            unsafe { warn(self.progress, Text::of(text)) }
        }
    }
}

/// Hands an emulator over.
fn handed(emulator: Box<dyn Emulator>) -> table::Emulator {
    table::Emulator {
        size: size_of::<table::Emulator>(),
        dimension: emulator.dimension(),
        outputs: emulator.outputs(),
        functions: &raw const EMULATOR,
        emulator: begin(Owned::new(emulator)),
    }
}

/// An emulator with its linear form, which is handed over for as long as the emulator is there.
struct Owned {
    /// Looks at the emulator, and so ends before it.
    linear: OnceLock<ServedLinear<'static>>,
    emulator: Box<dyn Emulator>,
}

impl Owned {
    fn new(emulator: Box<dyn Emulator>) -> Self {
        Self { linear: OnceLock::new(), emulator }
    }

    /// The linear form, if it has one; whoever gets it may use it until this value ends.
    fn linear(&self) -> Option<Linear> {
        let linear = self.emulator.linear()?;
        let served = self.linear.get_or_init(|| {
            // SAFETY: what is referred to belongs to the emulator, which stays where it is in its box, is never changed, and
            // ends after this field. The reference leaves this value only inside a table, which is used no longer.
            ServedLinear::new(unsafe {
                std::mem::transmute::<&dyn forward::Linear, &'static dyn forward::Linear>(linear)
            })
        });
        Some(served.table())
    }
}

unsafe extern "C" fn fit<T: Surrogate + Authored>(
    plugin: *mut c_void,
    training: *const table::Training,
    key: Key,
    progress: *const table::Progress,
    made: *mut table::Emulator,
    answer: *const Answer,
) -> i32 {
    guard(answer, |_| {
        // SAFETY: the plugin that `create` made; all else is there for the time of the call.
        let (plugin, training, progress) = unsafe { (object::<T>(plugin), &*training, &*progress) };
        // SAFETY: as above.
        let (about, points, responses) = unsafe {
            (training.about.bytes(), training.points.matrix()?, training.responses.matrix()?)
        };
        let about: TrainingAbout = serde_json::from_slice(about)?;
        // SAFETY: as above.
        let functions = unsafe { progress.functions.as_ref() }.filter(|f| f.missing().is_none());
        let functions = *functions.ok_or_else(|| Refusal::stop("progress cannot be told"))?;
        let told = Told { progress: progress.progress, functions, said: 0.into() };
        let TrainingAbout { parameters, layouts } = &about;
        let runs = Training { parameters, layouts, points: &points, responses: &responses };
        let emulator = plugin.fit(&runs, &Stream::from_key(key.words), &Progress::new(&told))?;
        // SAFETY: the caller gives a place for one emulator.
        unsafe { *made = handed(emulator) };
        Ok(())
    })
}

unsafe extern "C" fn load<T: Surrogate + Authored>(
    plugin: *mut c_void,
    bytes: Text,
    made: *mut table::Emulator,
    answer: *const Answer,
) -> i32 {
    guard(answer, |_| {
        // SAFETY: as in `fit`.
        let (plugin, bytes) = unsafe { (object::<T>(plugin), bytes.bytes()) };
        let emulator = plugin.load(bytes)?;
        // SAFETY: the caller gives a place for one emulator.
        unsafe { *made = handed(emulator) };
        Ok(())
    })
}

unsafe extern "C" fn sum<T: Surrogate + Authored>(
    plugin: *mut c_void,
    parts: *const table::Summand,
    count: usize,
    offset: Numbers,
    made: *mut table::Emulator,
    answer: *const Answer,
) -> i32 {
    guard(answer, |_| {
        // SAFETY: as in `fit`; the pointer leads to so many parts.
        let (plugin, offset) = unsafe { (object::<T>(plugin), offset.slice()?) };
        let mut all = Vec::with_capacity(count);
        for i in 0..count {
            // SAFETY: as above.
            let part = unsafe { &*parts.add(i) };
            // SAFETY: what a part points to is there for the time of the call.
            let (bytes, weights) = unsafe { (part.bytes.bytes(), part.weights.slice()?) };
            all.push(Summand { bytes, weights });
        }
        let emulator = plugin.sum(&all, offset)?.ok_or_else(Refusal::absent)?;
        // SAFETY: the caller gives a place for one emulator.
        unsafe { *made = handed(emulator) };
        Ok(())
    })
}

/// The emulator behind the first argument.
///
/// # Safety
/// It was made by [`handed`] and not ended.
unsafe fn own<'a>(emulator: *mut c_void) -> &'a dyn Emulator {
    // SAFETY: as the caller promises.
    &*unsafe { object::<Owned>(emulator) }.emulator
}

unsafe extern "C" fn mean(
    this: *mut c_void,
    points: Numbers,
    to: *mut f64,
    answer: *const Answer,
) -> i32 {
    guard(answer, |_| {
        // SAFETY: an emulator of ours, and numbers that are there for the time of the call.
        let (emulator, points) = unsafe { (own(this), points.matrix()?) };
        // SAFETY: the buffer holds `points x outputs` numbers.
        unsafe { fill(to, points.rows() * emulator.outputs(), emulator.mean(&points).as_slice()) }
    })
}

unsafe extern "C" fn variance(
    this: *mut c_void,
    points: Numbers,
    to: *mut f64,
    answer: *const Answer,
) -> i32 {
    guard(answer, |_| {
        // SAFETY: as in `mean`.
        let (emulator, points) = unsafe { (own(this), points.matrix()?) };
        let variance = emulator.variance(&points).ok_or_else(Refusal::absent)?;
        // SAFETY: the buffer holds `points x outputs` numbers.
        unsafe { fill(to, points.rows() * emulator.outputs(), variance.as_slice()) }
    })
}

unsafe extern "C" fn jacobian(
    this: *mut c_void,
    point: Numbers,
    to: *mut f64,
    answer: *const Answer,
) -> i32 {
    guard(answer, |_| {
        // SAFETY: as in `mean`.
        let (emulator, point) = unsafe { (own(this), point.slice()?) };
        // SAFETY: the buffer holds `outputs x parameters` numbers.
        unsafe { fill(to, point.len() * emulator.outputs(), emulator.jacobian(point).as_slice()) }
    })
}

unsafe extern "C" fn mean_and_jacobian(
    this: *mut c_void,
    point: Numbers,
    parameters: *const usize,
    count: usize,
    mean: *mut f64,
    jacobian: *mut f64,
    answer: *const Answer,
) -> i32 {
    guard(answer, |_| {
        // SAFETY: as in `mean`.
        let (emulator, point) = unsafe { (own(this), point.slice()?) };
        let (means, slopes) = if parameters.is_null() {
            emulator.mean_and_jacobian(point)
        } else {
            // SAFETY: the pointer is not null, and leads to so many numbers of parameters.
            let parameters = unsafe { std::slice::from_raw_parts(parameters, count) };
            if let Some(odd) = parameters.iter().find(|&&i| i >= emulator.dimension()) {
                return Err(Refusal::stop(format!("was asked for the parameter number {odd}")));
            }
            emulator.mean_and_jacobian_by(point, parameters)
        };
        // SAFETY: the buffers hold `outputs` and `outputs x count` numbers.
        unsafe {
            fill(mean, emulator.outputs(), &means)?;
            fill(jacobian, emulator.outputs() * count, slopes.as_slice())
        }
    })
}

unsafe extern "C" fn fit_error(this: *mut c_void, answer: *const Answer) -> i32 {
    guard(answer, |out| {
        // SAFETY: as in `mean`.
        let error = unsafe { own(this) }.fit_error();
        out.row(&error.relative);
        out.numbers(&error.residuals);
        Ok(())
    })
}

unsafe extern "C" fn save(this: *mut c_void, answer: *const Answer) -> i32 {
    guard(answer, |out| {
        // SAFETY: as in `mean`.
        out.bytes(&unsafe { own(this) }.save()?);
        Ok(())
    })
}

unsafe extern "C" fn linear(this: *mut c_void, made: *mut Linear, answer: *const Answer) -> i32 {
    guard(answer, |_| {
        // SAFETY: as in `mean`.
        let linear = unsafe { object::<Owned>(this) }.linear().ok_or_else(Refusal::absent)?;
        // SAFETY: the caller gives a place for one map.
        unsafe { *made = linear };
        Ok(())
    })
}

unsafe extern "C" fn sensitivity(this: *mut c_void, answer: *const Answer) -> i32 {
    guard(answer, |out| {
        // SAFETY: as in `mean`.
        out.json(&unsafe { own(this) }.sensitivity().ok_or_else(Refusal::absent)?)
    })
}

unsafe extern "C" fn facts(this: *mut c_void, answer: *const Answer) -> i32 {
    // SAFETY: as in `mean`.
    guard(answer, |out| out.json(&unsafe { own(this) }.facts()))
}
