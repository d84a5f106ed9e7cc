//! Structs of Thrift's compact protocol, in which the footer of a Parquet file is written.
//!
//! Source: `doc/specs/thrift-compact-protocol.md` of the repository apache/thrift.

const I32: u8 = 5;
const I64: u8 = 6;
const BINARY: u8 = 8;
const LIST: u8 = 9;
const STRUCT: u8 = 12;

/// A struct. Fields are added in the order of their numbers.
#[derive(Default)]
pub struct Struct {
    bytes: Vec<u8>,
    /// Number of the last field.
    last: u8,
}

impl Struct {
    /// Adds a number of 32 bits, which may be an enumeration.
    pub fn int(self, field: u8, value: i64) -> Self {
        self.with(field, I32, |bytes| integer(bytes, value))
    }

    /// Adds a number of 64 bits.
    pub fn long(self, field: u8, value: i64) -> Self {
        self.with(field, I64, |bytes| integer(bytes, value))
    }

    /// Adds a text.
    pub fn text(self, field: u8, value: &str) -> Self {
        self.with(field, BINARY, |bytes| text(bytes, value))
    }

    /// Adds a struct.
    pub fn inner(self, field: u8, value: Self) -> Self {
        self.with(field, STRUCT, |bytes| bytes.extend(value.end()))
    }

    /// Adds a list of numbers of 32 bits.
    pub fn ints(self, field: u8, values: &[i64]) -> Self {
        self.list(field, I32, values.len(), |bytes| {
            for value in values {
                integer(bytes, *value);
            }
        })
    }

    /// Adds a list of texts.
    pub fn texts(self, field: u8, values: &[&str]) -> Self {
        self.list(field, BINARY, values.len(), |bytes| {
            for value in values {
                text(bytes, value);
            }
        })
    }

    /// Adds a list of structs.
    pub fn structs(self, field: u8, values: Vec<Self>) -> Self {
        self.list(field, STRUCT, values.len(), |bytes| {
            bytes.extend(values.into_iter().flat_map(Self::end));
        })
    }

    /// The bytes of the struct, with its end.
    pub fn end(mut self) -> Vec<u8> {
        self.bytes.push(0);
        self.bytes
    }

    fn list(self, field: u8, of: u8, count: usize, write: impl FnOnce(&mut Vec<u8>)) -> Self {
        self.with(field, LIST, |bytes| {
            // A count of 15 and more has bytes of its own.
            if count < 15 {
                bytes.push((count as u8) << 4 | of);
            } else {
                bytes.push(0xf0 | of);
                variable_length(bytes, count as u64);
            }
            write(bytes);
        })
    }

    fn with(mut self, field: u8, of: u8, write: impl FnOnce(&mut Vec<u8>)) -> Self {
        // The number of a field is written as its distance from the one before it, which is below 16 in Parquet.
        self.bytes.push((field - self.last) << 4 | of);
        self.last = field;
        write(&mut self.bytes);
        self
    }
}

/// Writes a number of variable length: seven bits a byte, the lowest first, the highest bit where more follow.
pub fn variable_length(bytes: &mut Vec<u8>, mut value: u64) {
    while value >= 0x80 {
        bytes.push(value as u8 | 0x80);
        value >>= 7;
    }
    bytes.push(value as u8);
}

/// Writes a signed number: its sign in the lowest bit.
fn integer(bytes: &mut Vec<u8>, value: i64) {
    variable_length(bytes, ((value << 1) ^ (value >> 63)) as u64);
}

fn text(bytes: &mut Vec<u8>, value: &str) {
    variable_length(bytes, value.len() as u64);
    bytes.extend(value.as_bytes());
}

#[cfg(test)]
mod tests {
    use super::{Struct, integer, variable_length};

    /// The examples of the specification.
    #[test]
    fn numbers_have_the_bytes_of_the_specification() {
        let mut bytes = Vec::new();
        variable_length(&mut bytes, 50_399);
        assert_eq!(bytes, [0xdf, 0x89, 0x03]);
        for (value, right) in [(0, 0), (-1, 1), (1, 2), (-2, 3), (2, 4)] {
            let mut bytes = Vec::new();
            integer(&mut bytes, value);
            assert_eq!(bytes, [right]);
        }
    }

    #[test]
    fn fields_and_lists_have_their_headers() {
        let bytes = Struct::default().int(1, 1).text(4, "ab").ints(5, &[0; 15]).end();
        let mut right = vec![0x15, 2, 0x38, 2, b'a', b'b', 0x19, 0xf5, 15];
        right.extend([0; 16]);
        assert_eq!(bytes, right);
    }
}
