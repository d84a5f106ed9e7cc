//! Surrogates of a library.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, OnceLock};

use lacuna::math::random::Stream;
use lacuna::plugin::forward;
use lacuna::plugin::surrogate::{Emulator, Summand, Surrogate, Training};
use lacuna::run::{Fault, Observer, Progress};
use lacuna_abi::argument::{Buffer, Lent, Rows, Space};
use lacuna_abi::guard::{Done, Out, begin};
use lacuna_abi::linear::ServedLinear;
use lacuna_abi::table::{
    self, EmulatorFunctions, Linear, ProgressFunctions, ServeEmulator, ServeSurrogate, copied,
};
use lacuna_abi::wire::TrainingAbout;
use lacuna_abi::{Object, Refusal};

use super::{Authored, Plugin};

static EMULATOR: EmulatorFunctions = EmulatorFunctions::of::<Owned>();

/// Tells the program how far a fit came; it counts units, not totals.
struct Told {
    progress: Object<ProgressFunctions>,
    said: AtomicU64,
}

impl Observer for Told {
    fn begin(&self, _: &str, _: &str, _: u64) {}
    fn advance(&self, done: u64) {
        let before = self.said.fetch_max(done, Ordering::Relaxed);
        if done > before {
            // SAFETY: the progress is there for the time of the fit.
            unsafe { self.progress.add(done - before) };
        }
    }
    fn end(&self, _: &str, _: &str) {}
    fn warn(&self, text: &str) {
        // SAFETY: as in `advance`.
        unsafe { self.progress.warn(text) };
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
    fn form(&self) -> Option<Linear> {
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

impl<T: Surrogate + Authored> ServeSurrogate for Plugin<T> {
    fn fit(
        &self,
        training: Lent<'_, table::Training>,
        key: Stream,
        progress: Lent<'_, table::Progress>,
        made: Space<'_, table::Emulator>,
        _: &Out,
    ) -> Done {
        // SAFETY: the table gives runs and progress, and all that they point to is there for the time of the call.
        let (about, points, responses, progress) = unsafe {
            let training = training.one();
            let (points, responses) = (training.points.matrix()?, training.responses.matrix()?);
            (training.about.bytes(), points, responses, progress.one())
        };
        let about: TrainingAbout = serde_json::from_slice(about)?;
        // SAFETY: as above.
        let functions = unsafe { copied(progress.functions) }
            .map_err(|_| Refusal::stop("progress cannot be told"))?;
        let fault = Arc::new(Fault::new("the program"));
        let progress = Object::new(progress.progress, functions, None, fault);
        let told = Told { progress, said: AtomicU64::new(0) };
        let TrainingAbout { parameters, layouts } = &about;
        let runs = Training {
            parameters,
            layouts,
            points: &points,
            responses: &responses,
            gradients: None,
        };
        let emulator = self.0.fit(&runs, &key, &Progress::new(&told))?;
        // SAFETY: the caller gives a place for one emulator.
        unsafe { made.put(handed(emulator)) };
        Ok(())
    }

    fn load(&self, bytes: &[u8], made: Space<'_, table::Emulator>, _: &Out) -> Done {
        let emulator = self.0.load(bytes)?;
        // SAFETY: the caller gives a place for one emulator.
        unsafe { made.put(handed(emulator)) };
        Ok(())
    }

    fn sum(
        &self,
        parts: Lent<'_, table::Summand>,
        count: usize,
        offset: Rows<'_>,
        made: Space<'_, table::Emulator>,
        _: &Out,
    ) -> Done {
        let mut all = Vec::with_capacity(count);
        // SAFETY: the call says how many parts there are.
        for part in unsafe { parts.all(count) } {
            // SAFETY: what a part points to is there for the time of the call.
            let (bytes, weights) = unsafe { (part.bytes.bytes(), part.weights.slice()?) };
            all.push(Summand { bytes, weights });
        }
        let emulator = self.0.sum(&all, &offset)?.ok_or_else(Refusal::absent)?;
        // SAFETY: the caller gives a place for one emulator.
        unsafe { made.put(handed(emulator)) };
        Ok(())
    }
}

impl ServeEmulator for Owned {
    fn mean(&self, points: Rows<'_>, to: Buffer<'_>, _: &Out) -> Done {
        let mean = self.emulator.mean(&points.matrix());
        // SAFETY: the buffer holds `points x outputs` numbers.
        unsafe { to.fill(points.rows * self.emulator.outputs(), mean.as_slice()) }
    }

    fn variance(&self, points: Rows<'_>, to: Buffer<'_>, _: &Out) -> Done {
        let variance = self.emulator.variance(&points.matrix()).ok_or_else(Refusal::absent)?;
        // SAFETY: the buffer holds `points x outputs` numbers.
        unsafe { to.fill(points.rows * self.emulator.outputs(), variance.as_slice()) }
    }

    fn jacobian(&self, point: Rows<'_>, to: Buffer<'_>, _: &Out) -> Done {
        let jacobian = self.emulator.jacobian(&point);
        // SAFETY: the buffer holds `outputs x parameters` numbers.
        unsafe { to.fill(point.len() * self.emulator.outputs(), jacobian.as_slice()) }
    }

    fn mean_and_jacobian(
        &self,
        point: Rows<'_>,
        parameters: Lent<'_, usize>,
        count: usize,
        mean: Buffer<'_>,
        jacobian: Buffer<'_>,
        _: &Out,
    ) -> Done {
        let emulator = &self.emulator;
        let (means, slopes) = if parameters.is_null() {
            emulator.mean_and_jacobian(&point)
        } else {
            // SAFETY: the call says how many numbers of parameters there are.
            let parameters = unsafe { parameters.all(count) };
            if let Some(odd) = parameters.iter().find(|&&i| i >= emulator.dimension()) {
                return Err(Refusal::stop(format!("was asked for the parameter number {odd}")));
            }
            emulator.mean_and_jacobian_by(&point, forward::Wanted::by(parameters))
        };
        // SAFETY: the buffers hold `outputs` and `outputs x count` numbers.
        unsafe {
            mean.fill(emulator.outputs(), &means)?;
            jacobian.fill(emulator.outputs() * count, slopes.as_slice())
        }
    }

    fn fit_error(&self, out: &Out) -> Done {
        let error = self.emulator.fit_error();
        out.row(&error.relative);
        out.numbers(&error.residuals);
        Ok(())
    }

    fn save(&self, out: &Out) -> Done {
        out.bytes(&self.emulator.save()?);
        Ok(())
    }

    fn linear(&self, made: Space<'_, Linear>, _: &Out) -> Done {
        let linear = self.form().ok_or_else(Refusal::absent)?;
        // SAFETY: the caller gives a place for one map.
        unsafe { made.put(linear) };
        Ok(())
    }

    fn sensitivity(&self, out: &Out) -> Done {
        out.json(&self.emulator.sensitivity().ok_or_else(Refusal::absent)?)
    }

    fn facts(&self, out: &Out) -> Done {
        out.json(&self.emulator.facts())
    }
}
