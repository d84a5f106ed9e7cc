//! Texts, numbers, and the way in which results of unknown length come back.

use std::ffi::c_void;

record! {
    /// Text in UTF-8, or bytes, without a zero at the end. Structured data are JSON.
    Text {
        /// The first byte; may be null when there is none.
        bytes: *const u8,
        /// The number of bytes.
        length: usize,
    }
}

record! {
    /// A matrix of numbers row by row: entry `(i, j)` is `values[i * columns + j]`. One point, one response a row.
    Numbers {
        /// The first number; may be null when there is none.
        values: *const f64,
        /// The number of rows.
        rows: usize,
        /// The number of columns.
        columns: usize,
    }
}

record! {
    /// The name of a stream of random numbers: one key, one sequence. What is drawn must depend on the key alone.
    Key {
        /// The words of the key, any of which is a good seed.
        words: [u64; 4],
    }
}

record! {
    /// Takes results of a length that the caller does not know, and the message of an error. What is given to it is
    /// copied before it returns. It is there for the time of one call and used by one thread.
    Answer {
        /// The size of this struct in bytes.
        size: usize,
        /// Whatever the functions need.
        context: *mut c_void,
        /// Appends to the text of the answer.
        text: Option<unsafe extern "C" fn(context: *mut c_void, text: Text)>,
        /// Adds a matrix to the answer.
        numbers: Option<unsafe extern "C" fn(context: *mut c_void, numbers: Numbers)>,
    }
}

/// What a function returns.
pub mod status {
    /// All is well.
    pub const OK: i32 = 0;
    /// No answer for these arguments; others may do. The text of the answer says why.
    pub const REJECTED: i32 = 1;
    /// No answer for any arguments. The text of the answer says why.
    pub const FATAL: i32 = 2;
    /// The stage cannot go on. The text of the answer says why.
    pub const STOP: i32 = 3;
    /// The code panicked. The text of the answer is its message.
    pub const PANIC: i32 = 4;
    /// The plugin does not have this; all is well.
    pub const ABSENT: i32 = 5;

    /// Every status with its meaning.
    pub const ALL: [(&str, i32, &str); 6] = [
        ("OK", OK, "All is well."),
        ("REJECTED", REJECTED, "No answer for these arguments; others may do. The text says why."),
        ("FATAL", FATAL, "No answer for any arguments. The text says why."),
        ("STOP", STOP, "The stage cannot go on. The text says why."),
        ("PANIC", PANIC, "The code panicked. The text is its message."),
        ("ABSENT", ABSENT, "The plugin does not have this; all is well."),
    ];
}

impl Text {
    /// A text of the caller's, which must live as long as it is looked at.
    pub const fn of(text: &str) -> Self {
        Self { bytes: text.as_ptr(), length: text.len() }
    }

    /// Bytes of the caller's.
    pub const fn of_bytes(bytes: &[u8]) -> Self {
        Self { bytes: bytes.as_ptr(), length: bytes.len() }
    }

    /// The bytes.
    ///
    /// # Safety
    /// The pointer is null or leads to `length` bytes that nobody changes during `'a`.
    pub unsafe fn bytes<'a>(self) -> &'a [u8] {
        if self.bytes.is_null() || self.length == 0 {
            return &[];
        }
        // SAFETY: the caller promises the length and the time.
        unsafe { std::slice::from_raw_parts(self.bytes, self.length) }
    }

    /// The text, with a mark where it is not UTF-8.
    ///
    /// # Safety
    /// As for [`Text::bytes`].
    pub unsafe fn string(self) -> String {
        // SAFETY: as the caller promises.
        String::from_utf8_lossy(unsafe { self.bytes() }).into_owned()
    }
}

impl Numbers {
    /// A view of a matrix.
    pub fn of(matrix: &crate::linalg::Matrix) -> Self {
        let values = matrix.as_slice().as_ptr();
        Self { values, rows: matrix.rows(), columns: matrix.columns() }
    }

    /// A view of one row.
    pub fn row(row: &[f64]) -> Self {
        Self { values: row.as_ptr(), rows: 1, columns: row.len() }
    }

    /// The numbers row by row.
    ///
    /// # Safety
    /// The pointer is null or leads to `rows x columns` numbers that nobody changes during `'a`.
    pub unsafe fn slice<'a>(self) -> &'a [f64] {
        let count = self.rows.saturating_mul(self.columns);
        if self.values.is_null() || count == 0 {
            return &[];
        }
        // SAFETY: the caller promises the number and the time.
        unsafe { std::slice::from_raw_parts(self.values, count) }
    }

    /// The numbers as a matrix of one's own.
    ///
    /// # Safety
    /// As for [`Numbers::slice`].
    pub unsafe fn matrix(self) -> crate::linalg::Matrix {
        // SAFETY: as the caller promises.
        let values = unsafe { self.slice() };
        let rows = if self.columns == 0 || !values.is_empty() { self.rows } else { 0 };
        crate::linalg::Matrix::from_vec(rows, self.columns, values.to_vec())
    }
}
