//! Messages to and from a worker: a line of JSON, the numbers of matrices, and bytes.

use std::io::{self, BufRead, Read as _, Write};

use lacuna::matrix::Matrix;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value as Json};

/// A message.
#[derive(Debug, Clone, Default)]
pub struct Message {
    /// Head, in JSON.
    pub head: Map<String, Json>,
    /// Matrices.
    pub matrices: Vec<Matrix>,
    /// Bytes.
    pub bytes: Vec<u8>,
}

/// The line with which a message begins.
#[derive(Serialize, Deserialize)]
struct Line<H> {
    head: H,
    matrices: Vec<[usize; 2]>,
    bytes: usize,
}

impl Message {
    /// Reads a message; `None` at the end.
    pub fn read(source: &mut impl BufRead) -> io::Result<Option<Self>> {
        let mut line = String::new();
        if source.read_line(&mut line)? == 0 {
            return Ok(None);
        }
        let Line { head, matrices: shapes, bytes: count } =
            serde_json::from_str(&line).map_err(io::Error::other)?;
        let mut matrices = Vec::new();
        for [rows, columns] in shapes {
            let count = rows.checked_mul(columns).and_then(|count| count.checked_mul(8));
            let bytes = exactly(source, count.ok_or(io::ErrorKind::InvalidData)?)?;
            let (numbers, _) = bytes.as_chunks::<8>();
            let numbers = numbers.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect();
            matrices.push(Matrix::from_vec(rows, columns, numbers));
        }
        let bytes = exactly(source, count)?;
        Ok(Some(Self { head, matrices, bytes }))
    }
}

/// So many bytes, which need not fit in memory before they are there.
fn exactly(source: &mut impl BufRead, count: usize) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    source.take(count as u64).read_to_end(&mut bytes)?;
    if bytes.len() == count { Ok(bytes) } else { Err(io::ErrorKind::UnexpectedEof.into()) }
}

/// Writes a message.
pub fn write(
    to: &mut impl Write,
    head: &Map<String, Json>,
    matrices: &[&Matrix],
    bytes: &[u8],
) -> io::Result<()> {
    let shapes = matrices.iter().map(|matrix| [matrix.rows(), matrix.columns()]).collect();
    let line = Line { head, matrices: shapes, bytes: bytes.len() };
    let mut all = serde_json::to_vec(&line)?;
    all.push(b'\n');
    for matrix in matrices {
        for part in matrix.as_slice().chunks(AT_A_TIME) {
            all.extend(part.iter().flat_map(|x| x.to_le_bytes()));
            to.write_all(&all)?;
            all.clear();
        }
    }
    to.write_all(&all)?;
    to.write_all(bytes)?;
    to.flush()
}

/// Numbers written at a time: the other side reads them while the next ones are made.
const AT_A_TIME: usize = 1 << 13;

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;
    use serde_json::json;

    #[test]
    fn a_message_comes_back_to_the_bit() {
        let matrix = Matrix::from_vec(2, 2, vec![0.1, f64::NAN, -0.0, 1e-310]);
        let head = json!({ "do": "step" }).as_object().unwrap().clone();
        let mut bytes = Vec::new();
        write(&mut bytes, &head, &[&matrix, &Matrix::zeros(0, 3)], b"end\n").unwrap();
        let read = Message::read(&mut &bytes[..]).unwrap().unwrap();
        let bits = |m: &Matrix| m.as_slice().iter().map(|x| x.to_bits()).collect::<Vec<_>>();
        assert_eq!((read.head, bits(&read.matrices[0])), (head, bits(&matrix)));
        assert_eq!((read.matrices[1].columns(), &read.bytes[..]), (3, &b"end\n"[..]));
        assert!(Message::read(&mut &bytes[..0]).unwrap().is_none());
        assert!(Message::read(&mut &bytes[..bytes.len() - 1]).is_err());
    }

    #[test]
    fn a_size_that_no_memory_holds_is_an_error() {
        let line = format!("{{\"head\":{{}},\"matrices\":[[{0},{0}]],\"bytes\":0}}\n", usize::MAX);
        assert!(Message::read(&mut line.as_bytes()).is_err());
    }
}
