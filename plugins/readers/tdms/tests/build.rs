//! Segments byte for byte, as NI's document describes them.

/// Numbers in one byte order.
pub struct Writer {
    pub bytes: Vec<u8>,
    pub big: bool,
}

impl Writer {
    pub fn new(big: bool) -> Self {
        Self { bytes: Vec::new(), big }
    }

    /// Adds bytes that are given with the lowest first.
    pub fn number<const N: usize>(mut self, lowest_first: [u8; N]) -> Self {
        let mut own = lowest_first;
        if self.big {
            own.reverse();
        }
        self.bytes.extend(own);
        self
    }

    pub fn u32(self, x: u32) -> Self {
        self.number(x.to_le_bytes())
    }

    pub fn u64(self, x: u64) -> Self {
        self.number(x.to_le_bytes())
    }

    pub fn text(mut self, text: &str) -> Self {
        self = self.u32(text.len() as u32);
        self.bytes.extend(text.as_bytes());
        self
    }

    /// Adds an object that has no raw data or, with `0`, raw data as before; without properties.
    pub fn object(self, path: &str, header: u32) -> Self {
        self.text(path).u32(header).u32(0)
    }

    /// Adds an object with samples, without properties.
    pub fn samples(self, path: &str, code: u32, count: u64) -> Self {
        self.text(path).u32(20).u32(code).u32(1).u64(count).u32(0)
    }
}

pub const I16: u32 = 2;
pub const I32: u32 = 3;
pub const F64: u32 = 10;
pub const TEXT: u32 = 0x20;
pub const TIME: u32 = 0x44;
pub const NO_DATA: u32 = 0xffff_ffff;

// Bits of the table of contents.
pub const METADATA: u32 = 0x2;
pub const NEW_LIST: u32 = 0x4;
pub const RAW: u32 = 0x8;
pub const INTERLEAVED: u32 = 0x20;
pub const BIG: u32 = 0x40;
pub const DAQMX: u32 = 0x80;
/// A segment with all that a first one has.
pub const FIRST: u32 = METADATA | NEW_LIST | RAW;

/// A segment: lead-in, metadata, data.
pub fn segment(contents: u32, metadata: &[u8], data: &[u8]) -> Vec<u8> {
    let (raw, next) = (metadata.len() as u64, (metadata.len() + data.len()) as u64);
    with_offsets(contents, metadata, data, next, raw)
}

pub fn with_offsets(contents: u32, metadata: &[u8], data: &[u8], next: u64, raw: u64) -> Vec<u8> {
    let lead_in = Writer::new(contents & BIG != 0).u32(4713).u64(next).u64(raw).bytes;
    [b"TDSm", &contents.to_le_bytes()[..], &lead_in, metadata, data].concat()
}

/// Samples of an interleaved or contiguous chunk.
pub fn doubles(big: bool, numbers: &[f64]) -> Vec<u8> {
    numbers.iter().fold(Writer::new(big), |w, x| w.number(x.to_le_bytes())).bytes
}
