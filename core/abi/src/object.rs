//! An object of the other side: its functions, and how its answers are taken.

use std::ffi::c_void;
use std::sync::Arc;

use lacuna::plugin::model::EvalError;
use lacuna::run::Stop;
use lacuna::run::fault::Fault;
use serde::de::DeserializeOwned;

use crate::basic::Answer;
use crate::check::{UNMARKED, densities_only, marks, numbers_only};
use crate::shape::{Table, read, whole};
use crate::{Refusal, Reply, status, watch};

/// An object of the other side, with its functions: the calls are made from the tables.
pub struct Object<F> {
    /// The first argument of its functions.
    pub this: *mut c_void,
    /// The functions.
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

    /// The record of answers that failed: an object with a fault is used no more.
    pub fn fault(&self) -> &Arc<Fault> {
        &self.fault
    }

    /// Calls a function of the object, which may not have it.
    pub fn ask<C>(
        &self,
        what: &'static str,
        function: Option<C>,
        call: impl FnOnce(C, *const Answer) -> i32,
    ) -> Asked {
        let Some(function) = function else { return Asked { what, reply: Ok(None) } };
        let asked = || Reply::of(what, |answer| call(function, answer));
        let reply = match watch::inside(self.fault.who(), asked) {
            Ok(reply) => Ok(Some(reply)),
            Err(refusal) if refusal.status == status::ABSENT => Ok(None),
            Err(refusal) => Err(refusal),
        };
        Asked { what, reply }
    }

    /// The answer, or else `otherwise`: then the object has a fault.
    pub fn or_fault<T>(&self, answered: Result<T, Refusal>, otherwise: impl FnOnce() -> T) -> T {
        answered.unwrap_or_else(|refusal| {
            self.fault.report(refusal.message);
            otherwise()
        })
    }

    /// The answer, or why a stage cannot go on.
    pub fn or_stop<T>(&self, answered: Result<T, Refusal>) -> Result<T, Stop> {
        answered.map_err(|refusal| {
            let who = self.fault.who();
            match refusal.message.split_once("\nhelp: ") {
                Some((message, help)) => Stop::new(format!("{who}: {message}")).help(help),
                None => Stop::new(format!("{who}: {}", refusal.message)),
            }
        })
    }

    /// The answer, or why there is none.
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

/// The answer of an object.
#[derive(Debug)]
pub struct Asked {
    /// The function that was called.
    pub what: &'static str,
    reply: Result<Option<Reply>, Refusal>,
}

impl Asked {
    /// The answer; `None` where the object does not have what is asked for.
    pub fn if_any(self) -> Result<Option<Reply>, Refusal> {
        self.reply.map_err(|refusal| told(self.what, refusal))
    }

    /// The answer, which must be there; a refusal is as the other side says it, without the name of the function.
    pub fn demand_plain(self) -> Result<Reply, Refusal> {
        self.reply?.ok_or_else(|| missing(self.what))
    }

    /// The answer, which must be there.
    pub fn demand(self) -> Result<Reply, Refusal> {
        let what = self.what;
        self.if_any()?.ok_or_else(|| missing(what))
    }

    /// The text of an answer read as JSON: the default of its type where there is none.
    pub fn json_if_any<T: DeserializeOwned + Default>(self) -> Result<T, Refusal> {
        Ok(self.if_any()?.unwrap_or_default().json_if_any()?.unwrap_or_default())
    }
}

fn missing(what: &str) -> Refusal {
    Refusal::stop(format!("`{what}` is not there"))
}

/// The numbers that a call writes into a buffer, NaN where nothing was written; `None` where the object does not have what
/// is asked for.
pub fn filled_if_any(
    count: usize,
    call: impl FnOnce(*mut f64) -> Asked,
) -> Result<Option<Vec<f64>>, Refusal> {
    let mut filled = vec![f64::NAN; count];
    Ok(call(filled.as_mut_ptr()).if_any()?.map(|_| filled))
}

/// The numbers that a call writes, without NaN; `None` where the object does not have what is asked for.
pub fn numbers_if_any(
    count: usize,
    call: impl FnOnce(*mut f64) -> Asked,
) -> Result<Option<Vec<f64>>, Refusal> {
    let mut numbers = vec![f64::NAN; count];
    let asked = call(numbers.as_mut_ptr());
    let what = asked.what;
    let Some(_) = asked.if_any()? else { return Ok(None) };
    numbers_only(what, &numbers)?;
    Ok(Some(numbers))
}

/// The numbers that a call must write.
pub fn numbers(count: usize, call: impl FnOnce(*mut f64) -> Asked) -> Result<Vec<f64>, Refusal> {
    let mut numbers = vec![f64::NAN; count];
    let asked = call(numbers.as_mut_ptr());
    let what = asked.what;
    asked.demand()?;
    numbers_only(what, &numbers)?;
    Ok(numbers)
}

/// The log densities that a call must write.
pub fn densities(count: usize, call: impl FnOnce(*mut f64) -> Asked) -> Result<Vec<f64>, Refusal> {
    let mut what = "";
    let densities = numbers(count, |to| {
        let asked = call(to);
        what = asked.what;
        asked
    })?;
    densities_only(what, &densities)?;
    Ok(densities)
}

/// The mark that a call writes; `otherwise` where the object does not have what is asked for.
pub fn mark(otherwise: bool, call: impl FnOnce(*mut u8) -> Asked) -> Result<bool, Refusal> {
    let mut mark = UNMARKED;
    let asked = call(&raw mut mark);
    let what = asked.what;
    match asked.if_any()? {
        Some(_) => Ok(marks(what, &[mark])?[0]),
        None => Ok(otherwise),
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
