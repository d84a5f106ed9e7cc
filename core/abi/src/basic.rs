//! Texts, numbers, and the way in which results of unknown length come back.

use std::ffi::c_void;

use lacuna::math::random::Stream;
use lacuna::matrix::Matrix;

use crate::Refusal;

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

impl From<&str> for Text {
    fn from(text: &str) -> Self {
        Self::of(text)
    }
}

impl From<&String> for Text {
    fn from(text: &String) -> Self {
        Self::of(text)
    }
}

impl From<&[u8]> for Text {
    fn from(bytes: &[u8]) -> Self {
        Self::of_bytes(bytes)
    }
}

impl From<&Matrix> for Numbers {
    fn from(matrix: &Matrix) -> Self {
        Self::of(matrix)
    }
}

impl From<&[f64]> for Numbers {
    fn from(row: &[f64]) -> Self {
        Self::row(row)
    }
}

impl From<&Stream> for Key {
    fn from(stream: &Stream) -> Self {
        Self { words: stream.key() }
    }
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

    /// True where it can be a text: there are bytes where it says so, and not more than memory has addresses.
    pub fn is_sound(self) -> bool {
        self.length == 0 || (!self.bytes.is_null() && isize::try_from(self.length).is_ok())
    }

    /// The bytes; none where it cannot be a text.
    ///
    /// # Safety
    /// The pointer is null or leads to `length` bytes that nobody changes during `'a`.
    pub unsafe fn bytes<'a>(self) -> &'a [u8] {
        if self.length == 0 || !self.is_sound() {
            return &[];
        }
        // SAFETY: the caller promises the bytes and the time; there are not too many for a slice.
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
    pub fn of(matrix: &Matrix) -> Self {
        let values = matrix.as_slice().as_ptr();
        Self { values, rows: matrix.rows(), columns: matrix.columns() }
    }

    /// A view of one row.
    pub fn row(row: &[f64]) -> Self {
        Self { values: row.as_ptr(), rows: 1, columns: row.len() }
    }

    /// The number of values, or why it cannot be a matrix.
    fn count(self) -> Result<usize, Refusal> {
        const MOST: usize = isize::MAX as usize / size_of::<f64>();
        let Self { values, rows, columns } = self;
        let wrong = |what: &str| {
            Err(Refusal::stop(format!("gives {rows} rows of {columns} numbers, {what}")))
        };
        match rows.checked_mul(columns) {
            None => wrong("more than there can be"),
            Some(count) if count > MOST => wrong("more than there can be"),
            Some(0) => Ok(0),
            Some(_) if values.is_null() => wrong("and none is there"),
            Some(_) if !values.is_aligned() => wrong("where no number can be"),
            Some(count) => Ok(count),
        }
    }

    /// The numbers row by row, unless it cannot be a matrix.
    ///
    /// # Safety
    /// The pointer is null or leads to `rows x columns` numbers that nobody changes during `'a`.
    pub unsafe fn slice<'a>(self) -> Result<&'a [f64], Refusal> {
        match self.count()? {
            0 => Ok(&[]),
            // SAFETY: the caller promises the numbers and the time; they are aligned and not too many for a slice.
            count => Ok(unsafe { std::slice::from_raw_parts(self.values, count) }),
        }
    }

    /// The numbers as a matrix of one's own, unless it cannot be one.
    ///
    /// # Safety
    /// As for [`Numbers::slice`].
    pub unsafe fn matrix(self) -> Result<Matrix, Refusal> {
        // SAFETY: as the caller promises.
        let values = unsafe { self.slice()? };
        Ok(Matrix::from_vec(self.rows, self.columns, values.to_vec()))
    }
}
