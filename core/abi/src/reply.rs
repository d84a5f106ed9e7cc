//! The outside of a call to the other side: what it answers.

use std::ffi::c_void;

use lacuna::matrix::Matrix;
use serde::de::DeserializeOwned;

use crate::basic::{Answer, Numbers, Text};
use crate::guard::guard_number;
use crate::{Refusal, status};

/// The answer of a call beside its status.
#[derive(Debug, Default)]
pub struct Reply {
    /// The text.
    pub text: Vec<u8>,
    /// The matrices.
    pub matrices: Vec<Matrix>,
    /// The function that was called, for messages.
    pub what: &'static str,
    /// The reason why it cannot be an answer at all.
    broken: Option<String>,
}

unsafe extern "C" fn take_text(context: *mut c_void, text: Text) {
    guard_number((), || {
        // SAFETY: the context is the reply of the call that is under way, and the text is there meanwhile.
        let (reply, bytes) = unsafe { (&mut *context.cast::<Reply>(), text.bytes()) };
        if !text.is_sound() {
            reply.broken = Some(format!("gives a text of {} bytes, which cannot be", text.length));
        }
        reply.text.extend_from_slice(bytes);
    });
}

unsafe extern "C" fn take_numbers(context: *mut c_void, numbers: Numbers) {
    guard_number((), || {
        // SAFETY: as in `take_text`.
        let (reply, matrix) = unsafe { (&mut *context.cast::<Reply>(), numbers.matrix()) };
        match matrix {
            Ok(matrix) => reply.matrices.push(matrix),
            Err(refusal) => reply.broken = Some(refusal.message),
        }
    });
}

impl Reply {
    /// Calls the function `what` and takes what it answers; a status that is not `OK` is a refusal.
    pub fn of(
        what: &'static str,
        call: impl FnOnce(*const Answer) -> i32,
    ) -> Result<Self, Refusal> {
        let mut reply = Self { what, ..Self::default() };
        let answer = Answer {
            size: size_of::<Answer>(),
            context: (&raw mut reply).cast(),
            text: Some(take_text),
            numbers: Some(take_numbers),
        };
        let status = call(&raw const answer);
        if let Some(broken) = reply.broken.take() {
            return Err(reply.wrong(broken));
        }
        match status {
            status::OK => Ok(reply),
            known @ status::REJECTED..=status::ABSENT => Err(Refusal::new(known, reply.string())),
            other => {
                Err(reply.wrong(format!("answers with the status {other}, which has no meaning")))
            }
        }
    }

    /// The text, with a mark where it is not UTF-8.
    pub fn string(&self) -> String {
        String::from_utf8_lossy(&self.text).into_owned()
    }

    /// A complaint about the answer.
    fn wrong(&self, message: String) -> Refusal {
        let what = self.what;
        Refusal::stop(if what.is_empty() { message } else { format!("`{what}` {message}") })
    }

    /// The text read as JSON.
    pub fn json<T: DeserializeOwned>(&self) -> Result<T, Refusal> {
        serde_json::from_slice(&self.text)
            .map_err(|error| self.wrong(format!("answers JSON that cannot be read: {error}")))
    }

    /// The text read as JSON; `None` where nothing was written.
    pub fn json_if_any<T: DeserializeOwned>(&self) -> Result<Option<T>, Refusal> {
        if self.text.is_empty() { Ok(None) } else { self.json().map(Some) }
    }

    /// The matrices, of which there must be `N`.
    pub fn matrices<const N: usize>(mut self) -> Result<[Matrix; N], Refusal> {
        let count = self.matrices.len();
        std::mem::take(&mut self.matrices)
            .try_into()
            .map_err(|_| self.wrong(format!("answers {count} matrices where {N} belong")))
    }

    /// The only row of the only matrix.
    pub fn row(self) -> Result<Vec<f64>, Refusal> {
        let what = self.what;
        let [row] = self.matrices()?;
        match row.rows() {
            1 => Ok(row.into_vec()),
            count => Err(Self { what, ..Self::default() }
                .wrong(format!("answers {count} rows where one belongs"))),
        }
    }
}
