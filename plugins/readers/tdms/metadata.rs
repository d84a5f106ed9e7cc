//! Lead-in and metadata of a segment.
//!
//! Source: NI, *TDMS File Format Internal Structure*, sections "Lead In" and "Meta Data".

use std::collections::BTreeMap;

use super::bytes::{Bytes, Fault};
use super::kind::{Content, Property};

/// Number of bytes of a lead-in.
pub(super) const LEAD_IN: u64 = 28;
/// First bytes of a segment, and of a segment in an index file.
pub(super) const TAG: &[u8] = b"TDSm";
pub(super) const INDEX_TAG: &[u8] = b"TDSh";

/// Bits of the table of contents: the segment has metadata, which begin a list of objects, and raw data; the data are
/// interleaved; numbers have their highest byte first.
pub(super) const METADATA: u32 = 1 << 1;
pub(super) const NEW_LIST: u32 = 1 << 2;
pub(super) const RAW_DATA: u32 = 1 << 3;
pub(super) const INTERLEAVED: u32 = 1 << 5;
const BIG_ENDIAN: u32 = 1 << 6;

// Values in place of the length of an index of raw data.
const NO_DATA: u32 = 0xffff_ffff;
const AS_BEFORE: u32 = 0;
const FORMAT_CHANGING_SCALER: u32 = 0x1269;
const DIGITAL_LINE_SCALERS: [u32; 2] = [0x126a, 0x1369];
/// End of a segment that its writer did not finish.
const UNFINISHED: u64 = u64::MAX;

/// Lead-in of a segment, whose positions are inside of the file.
#[derive(Debug)]
pub(super) struct LeadIn {
    /// Position of the segment.
    pub start: u64,
    /// Position of its raw data, and of the segment that follows.
    pub data: u64,
    pub end: u64,
    /// True if numbers have their highest byte first.
    pub big: bool,
    /// True if the writer did not come to the end of the segment.
    pub unfinished: bool,
    contents: u32,
}

impl LeadIn {
    /// Returns true if this bit of the table of contents is set.
    pub fn has(&self, bit: u32) -> bool {
        self.contents & bit != 0
    }

    /// Reads a lead-in at the position `start` of a file with this length; `None` for a segment that was not finished
    /// and has no complete metadata.
    pub fn read(bytes: &[u8], start: u64, length: u64) -> Result<Option<Self>, Fault> {
        if bytes.len() < LEAD_IN as usize {
            let text = format!("the file ends after {} of the 28 bytes of a lead-in", bytes.len());
            return Err(Fault::new(start, text));
        }
        if !bytes.starts_with(TAG) {
            let found = String::from_utf8_lossy(&bytes[..4]);
            let text = format!("expected a segment, which begins with `TDSm`, found `{found}`");
            return Err(Fault::new(start, text));
        }
        // The table of contents has its lowest byte first in every segment.
        let contents = Bytes::new(&bytes[4..8], start + 4, false).u32()?;
        let big = contents & BIG_ENDIAN != 0;
        let mut rest = Bytes::new(&bytes[8..], start + 8, big);
        let version = rest.u32()?;
        if !matches!(version, 4712 | 4713) {
            let text = format!("the segment has the version {version}, expected 4712 or 4713");
            return Err(Fault::new(start + 8, text));
        }
        let (next, raw) = (rest.u64()?, rest.u64()?);
        let unfinished = next == UNFINISHED;
        let after = |offset: u64| (start + LEAD_IN).saturating_add(offset);
        let (data, end) = (after(raw), if unfinished { length } else { after(next) });
        if unfinished && data > length {
            return Ok(None);
        }
        if data > end || end > length {
            let text = format!(
                "the segment has its data at byte {data} and ends at byte {end}, and the file ends at byte {length}: was \
                 it cut off?"
            );
            return Err(Fault::new(start, text));
        }
        Ok(Some(Self { start, data, end, big, unfinished, contents }))
    }
}

/// Raw data of an object in a segment.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Index {
    /// The object has none.
    None,
    /// As in the segment before in which it had some.
    AsBefore,
    New(Chunk),
}

/// Samples of an object in a chunk of raw data.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Chunk {
    pub content: Content,
    /// Number of samples.
    pub count: u64,
    /// Number of bytes, if it is known.
    pub bytes: Option<u64>,
}

/// An object in the metadata of a segment.
#[derive(Debug)]
pub(super) struct Object {
    pub at: u64,
    pub path: String,
    pub index: Index,
    pub properties: BTreeMap<String, Property>,
}

/// Reads all objects of the metadata, in their order.
pub(super) fn objects(
    bytes: &mut Bytes<'_>,
    mut each: impl FnMut(Object) -> Result<(), Fault>,
) -> Result<(), Fault> {
    for _ in 0..bytes.u32()? {
        let at = bytes.at();
        let path = bytes.text()?;
        let index = index(bytes, &path)?;
        let mut properties = BTreeMap::new();
        for _ in 0..bytes.u32()? {
            let name = bytes.text()?;
            let value = Property::read(bytes, &name)?;
            properties.insert(name, value);
        }
        each(Object { at, path, index, properties })?;
    }
    Ok(())
}

fn index(bytes: &mut Bytes<'_>, path: &str) -> Result<Index, Fault> {
    let at = bytes.at();
    let header = bytes.u32()?;
    match header {
        NO_DATA => return Ok(Index::None),
        AS_BEFORE => return Ok(Index::AsBefore),
        _ => (),
    }
    let code = bytes.u32()?;
    let Some(content) = Content::of(code) else {
        return Err(Fault::new(at, format!("`{path}` has samples of the unknown type {code:#x}")));
    };
    let dimension = bytes.u32()?;
    if dimension != 1 {
        let text = format!("`{path}` has the dimension {dimension}, expected 1");
        return Err(Fault::new(at, text));
    }
    let count = bytes.u64()?;
    if header == FORMAT_CHANGING_SCALER || DIGITAL_LINE_SCALERS.contains(&header) {
        skip_scalers(bytes, header)?;
        let content = Content::Other("raw data of DAQmx", None);
        return Ok(Index::New(Chunk { content, count, bytes: None }));
    }
    let size = match content {
        Content::Text => Some(bytes.u64()?),
        _ if count == 0 => Some(0),
        _ => match content.size().map(|size| count.checked_mul(size)) {
            Some(None) => {
                let text = format!("`{path}` has {count} samples, more than a file can hold");
                return Err(Fault::new(at, text));
            }
            size => size.flatten(),
        },
    };
    Ok(Index::New(Chunk { content, count, bytes: size }))
}

/// Skips the scalers of `DAQmx`, and the widths of its buffers. The samples are not read, but what follows is.
fn skip_scalers(bytes: &mut Bytes<'_>, header: u32) -> Result<(), Fault> {
    // Type, buffer, offset, format of the samples, and number of the scale; the format of a digital line has one byte.
    let scaler = if header == FORMAT_CHANGING_SCALER { 20 } else { 17 };
    for _ in 0..bytes.u32()? {
        bytes.take(scaler)?;
    }
    for _ in 0..bytes.u32()? {
        bytes.take(4)?;
    }
    Ok(())
}
