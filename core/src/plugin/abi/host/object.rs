//! Something that lives in a library.

use std::ffi::c_void;
use std::sync::Arc;

use crate::linalg::Matrix;
use crate::plugin::abi::table::{Answer, Table, read, status, whole};
use crate::plugin::abi::{Refusal, Reply};
use crate::plugin::fault::Fault;
use crate::plugin::model::EvalError;
use crate::run::Stop;

/// Something that lives in a library, with what it does.
pub struct Object<F> {
    /// The first argument of its functions.
    pub this: *mut c_void,
    /// What it does.
    pub functions: F,
    destroy: Destroy,
    fault: Arc<Fault>,
}

/// The function that ends an object.
pub type Destroy = Option<unsafe extern "C" fn(*mut c_void)>;

// SAFETY: the rules of the boundary demand that objects can be used from any thread, and the library is never unloaded.
unsafe impl<F: Send> Send for Object<F> {}
// SAFETY: the rules of the boundary demand that objects can be used from several threads at once.
unsafe impl<F: Sync> Sync for Object<F> {}

impl<F> Drop for Object<F> {
    fn drop(&mut self) {
        if let Some(destroy) = self.destroy
            && !self.this.is_null()
        {
            // SAFETY: the object is this one's own, and this is its last use.
            unsafe { destroy(self.this) }
        }
    }
}

impl<F> Object<F> {
    /// An object that ends with this value.
    pub fn new(this: *mut c_void, functions: F, destroy: Destroy, fault: Arc<Fault>) -> Self {
        Self { this, functions, destroy, fault }
    }

    /// An object that a call made, with its table. One that cannot be used is ended here, if it can be.
    ///
    /// # Safety
    /// The table is null or has the size that it says; the object belongs to the caller.
    pub unsafe fn made(
        what: &str,
        this: *mut c_void,
        table: *const F,
        destroy: fn(&F) -> Destroy,
        fault: Arc<Fault>,
    ) -> Result<Self, Refusal>
    where
        F: Table,
    {
        let of = |refusal: Refusal| Refusal::stop(format!("its {what} {}", refusal.message));
        // SAFETY: as the caller promises.
        let functions = unsafe { read(table) }.map_err(of)?;
        if this.is_null() {
            return Err(Refusal::stop(format!("its {what} is not there")));
        }
        let object = Self::new(this, functions, destroy(&functions), fault);
        whole(&object.functions).map_err(of)?;
        Ok(object)
    }

    /// Where it says that it can answer no more.
    pub fn fault(&self) -> &Arc<Fault> {
        &self.fault
    }

    /// Makes a call; `None` where the object does not have what is asked for.
    pub fn ask(
        &self,
        what: &'static str,
        call: impl FnOnce(*const Answer) -> i32,
    ) -> Result<Option<Reply>, Refusal> {
        match Reply::of(what, call) {
            Ok(reply) => Ok(Some(reply)),
            Err(refusal) if refusal.status == status::ABSENT => Ok(None),
            Err(refusal) => Err(told(what, refusal)),
        }
    }

    /// Makes a call that must be answered.
    pub fn demand(
        &self,
        what: &'static str,
        call: impl FnOnce(*const Answer) -> i32,
    ) -> Result<Reply, Refusal> {
        self.ask(what, call)?.ok_or_else(|| Refusal::stop(format!("`{what}` is not there")))
    }

    /// Makes a call that fills a buffer, which holds NaN where nothing was written; `None` where the object does not
    /// have what is asked for.
    pub fn ask_filled(
        &self,
        what: &'static str,
        count: usize,
        call: impl FnOnce(*mut f64, *const Answer) -> i32,
    ) -> Result<Option<Vec<f64>>, Refusal> {
        let mut filled = vec![f64::NAN; count];
        let to = filled.as_mut_ptr();
        Ok(self.ask(what, |answer| call(to, answer))?.map(|_| filled))
    }

    /// The same with a buffer in which there must be numbers.
    pub fn ask_numbers(
        &self,
        what: &'static str,
        count: usize,
        call: impl FnOnce(*mut f64, *const Answer) -> i32,
    ) -> Result<Option<Vec<f64>>, Refusal> {
        let numbers = self.ask_filled(what, count, call)?;
        numbers.iter().try_for_each(|numbers| numbers_only(what, numbers))?;
        Ok(numbers)
    }

    /// Makes a call that writes one mark; `otherwise` where the object does not have what is asked for.
    pub fn mark(
        &self,
        what: &'static str,
        otherwise: bool,
        call: impl FnOnce(*mut u8, *const Answer) -> i32,
    ) -> Result<bool, Refusal> {
        let mut mark = UNMARKED;
        let to = &raw mut mark;
        match self.ask(what, |answer| call(to, answer))? {
            Some(_) => Ok(marks(what, &[mark])?[0]),
            None => Ok(otherwise),
        }
    }

    /// Makes a call that must fill a buffer with log densities.
    pub fn densities(
        &self,
        what: &'static str,
        count: usize,
        call: impl FnOnce(*mut f64, *const Answer) -> i32,
    ) -> Result<Vec<f64>, Refusal> {
        let densities = self.numbers(what, count, call)?;
        densities_only(what, &densities)?;
        Ok(densities)
    }

    /// Makes a call that must fill a buffer with numbers.
    pub fn numbers(
        &self,
        what: &'static str,
        count: usize,
        call: impl FnOnce(*mut f64, *const Answer) -> i32,
    ) -> Result<Vec<f64>, Refusal> {
        let numbers = self.ask_numbers(what, count, call)?;
        numbers.ok_or_else(|| Refusal::stop(format!("`{what}` is not there")))
    }

    /// What was answered, or else nothing in particular: then the object has a fault.
    pub fn or_fault<T>(&self, answered: Result<T, Refusal>, otherwise: impl FnOnce() -> T) -> T {
        answered.unwrap_or_else(|refusal| {
            self.fault.report(refusal.message);
            otherwise()
        })
    }

    /// What was answered, or why a stage cannot go on.
    pub fn or_stop<T>(&self, answered: Result<T, Refusal>) -> Result<T, Stop> {
        answered.map_err(|refusal| {
            let who = self.fault.who();
            match refusal.message.split_once("\nhelp: ") {
                Some((message, help)) => Stop::new(format!("{who}: {message}")).help(help),
                None => Stop::new(format!("{who}: {}", refusal.message)),
            }
        })
    }

    /// What was answered, or why there is no answer.
    pub fn or_error<T>(&self, answered: Result<T, Refusal>) -> Result<T, EvalError> {
        answered.map_err(|refusal| {
            let message = format!("{}: {}", self.fault.who(), refusal.message);
            if refusal.status == status::REJECTED {
                EvalError::Rejected(message)
            } else {
                EvalError::Fatal(message)
            }
        })
    }
}

/// A refusal that says of what.
fn told(what: &str, refusal: Refusal) -> Refusal {
    let Refusal { status, message } = refusal;
    let message = match (status, message.is_empty()) {
        (status::PANIC, _) => format!("`{what}` panicked: {message}"),
        (_, true) => format!("`{what}` fails and does not say why"),
        (_, false) => message,
    };
    Refusal { status, message }
}

/// Complains of what is no number, such as what was never written.
pub fn numbers_only(what: &str, numbers: &[f64]) -> Result<(), Refusal> {
    match numbers.iter().position(|x| x.is_nan()) {
        None => Ok(()),
        Some(i) => {
            let count = numbers.len();
            Err(Refusal::stop(format!("`{what}` gives no number as value {} of {count}", i + 1)))
        }
    }
}

/// Complains of what is no log density: those are finite or minus infinity.
pub fn densities_only(what: &str, densities: &[f64]) -> Result<(), Refusal> {
    numbers_only(what, densities)?;
    let endless = densities.iter().position(|x| *x == f64::INFINITY);
    endless.map_or(Ok(()), |i| Err(odd(what, densities, i)))
}

/// Complains of what is not finite.
pub fn finite_only(what: &str, numbers: &[f64]) -> Result<(), Refusal> {
    numbers_only(what, numbers)?;
    let infinite = numbers.iter().position(|x| x.is_infinite());
    infinite.map_or(Ok(()), |i| Err(odd(what, numbers, i)))
}

/// A number that is out of place.
fn odd(what: &str, numbers: &[f64], i: usize) -> Refusal {
    let (x, count) = (numbers[i], numbers.len());
    Refusal::stop(format!("`{what}` gives {x} as value {} of {count}", i + 1))
}

/// Marks, each of which must be 0 or 1; a buffer that was not written holds [`UNMARKED`].
pub fn marks(what: &str, marks: &[u8]) -> Result<Vec<bool>, Refusal> {
    let mark = |(i, mark): (usize, &u8)| match mark {
        0 => Ok(false),
        1 => Ok(true),
        other => Err(Refusal::stop(format!(
            "`{what}` gives {other} as mark {} of {}, expected 0 or 1",
            i + 1,
            marks.len()
        ))),
    };
    marks.iter().enumerate().map(mark).collect()
}

/// What stands in a buffer of marks before it is written.
pub const UNMARKED: u8 = 255;

/// Complains of a matrix of another shape.
pub fn shaped(
    what: &'static str,
    matrix: &Matrix,
    rows: usize,
    columns: usize,
) -> Result<(), Refusal> {
    if matrix.rows() == rows && matrix.columns() == columns {
        return Ok(());
    }
    let (found_rows, found_columns) = (matrix.rows(), matrix.columns());
    Err(Refusal::stop(format!(
        "`{what}` answers {found_rows} rows of {found_columns} numbers where {rows} of {columns} belong"
    )))
}
