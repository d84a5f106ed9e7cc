//! Channels of a file: what all its segments say of them.

use std::collections::BTreeMap;

use super::bytes::Fault;
use super::kind::{Content, Property};
use super::metadata::{Chunk, INTERLEAVED, Index, LeadIn, Object, RAW_DATA};
use super::pieces::Piece;

/// The objects of a file: itself, groups and channels.
#[derive(Debug, Default)]
pub(super) struct Objects {
    pub all: Vec<Known>,
    places: BTreeMap<String, usize>,
    /// Objects of the segment, in the order of their raw data.
    list: Vec<usize>,
    /// Those of the list that have raw data, by their place in the list.
    active: BTreeMap<usize, usize>,
}

/// An object.
#[derive(Debug, Default)]
pub(super) struct Known {
    /// Names of group and channel; none for the file itself.
    pub names: Vec<String>,
    pub properties: BTreeMap<String, Property>,
    pub pieces: Vec<Piece>,
    /// Reason why the samples are not read; the first if there are several.
    pub refused: Option<String>,
    /// Samples of a chunk, as the last segment that described them says.
    chunk: Option<Chunk>,
    /// Place in the list of the segment.
    listed: Option<usize>,
}

impl Known {
    fn refuse(&mut self, reason: &str) {
        self.refused.get_or_insert_with(|| reason.to_owned());
    }
}

impl Objects {
    /// An object by its names.
    pub fn find(&self, names: &[String]) -> Option<&Known> {
        self.places.get(&path(names)).map(|&i| &self.all[i])
    }

    /// Begins a segment with a list of objects of its own.
    pub fn clear_list(&mut self) {
        for &i in &self.list {
            self.all[i].listed = None;
        }
        self.list.clear();
        self.active.clear();
    }

    /// Takes what the metadata of a segment say of an object.
    pub fn take(&mut self, object: Object) -> Result<(), Fault> {
        let names = names(&object.path).ok_or_else(|| {
            let text = format!(
                "expected a path such as `/'group'/'channel'`, found `{}`",
                shortened(&object.path)
            );
            Fault::new(object.at, text)
        })?;
        let number = *self.places.entry(path(&names)).or_insert_with(|| {
            self.all.push(Known { names, ..Known::default() });
            self.all.len() - 1
        });
        let known = &mut self.all[number];
        known.properties.extend(object.properties);
        let place = *known.listed.get_or_insert_with(|| {
            self.list.push(number);
            self.list.len() - 1
        });
        match object.index {
            Index::None => {
                self.active.remove(&place);
                return Ok(());
            }
            Index::New(chunk) => known.chunk = Some(chunk),
            Index::AsBefore if known.chunk.is_some() => (),
            Index::AsBefore => {
                let text = format!(
                    "`{}` has its samples as in an earlier segment, and none describes them",
                    shortened(&object.path)
                );
                return Err(Fault::new(object.at, text));
            }
        }
        self.active.insert(place, number);
        Ok(())
    }

    /// Divides the raw data of a segment among the objects of its list.
    ///
    /// The data are chunks of the same form, one after the other. The last may be shorter: in a segment that was not
    /// finished it ends anywhere, otherwise each channel has the same part of its samples.
    pub fn place(&mut self, segment: &LeadIn) -> Result<(), Fault> {
        let raw = segment.end - segment.data;
        if raw == 0 || !segment.has(RAW_DATA) {
            return Ok(());
        }
        let fault = |text: String| Fault::new(segment.start, text);
        let chunk_of = |i: &usize| self.all[*i].chunk.as_ref().map(|chunk| (*i, chunk.clone()));
        let chunks: Vec<(usize, Chunk)> = self
            .active
            .values()
            .filter_map(chunk_of)
            .filter(|(_, chunk)| chunk.count > 0 && chunk.bytes != Some(0))
            .collect();
        if chunks.iter().any(|(_, chunk)| chunk.bytes.is_none()) {
            for (i, chunk) in &chunks {
                self.all[*i].refuse(&reason(chunk).unwrap_or_else(|| {
                    "shares a segment with samples whose place in the file is not known".to_owned()
                }));
            }
            return Ok(());
        }
        let whole = chunks.iter().try_fold(0_u64, |sum, (_, chunk)| sum.checked_add(chunk.bytes?));
        let whole = whole.ok_or_else(|| fault("the samples of a chunk overflow".to_owned()))?;
        if whole == 0 {
            return Err(fault(format!("the segment has {raw} bytes of data, and no channel")));
        }
        // A single channel of text may be called interleaved.
        let sized = chunks.iter().all(|(_, chunk)| chunk.content.size().is_some());
        if segment.has(INTERLEAVED) && (sized || chunks.len() > 1) {
            self.place_interleaved(segment, &chunks)
        } else {
            self.place_contiguous(segment, &chunks, whole)
        }
    }

    /// Data of which each row has one sample of each channel.
    fn place_interleaved(
        &mut self,
        segment: &LeadIn,
        chunks: &[(usize, Chunk)],
    ) -> Result<(), Fault> {
        let fault = |text: &str| Fault::new(segment.start, text);
        if chunks.iter().any(|(_, chunk)| chunk.count != chunks[0].1.count) {
            return Err(fault(
                "the segment is interleaved, and its channels have different lengths",
            ));
        }
        let width = chunks.iter().try_fold(0, |sum, (_, chunk)| Some(sum + chunk.content.size()?));
        let width = width.ok_or_else(|| fault("the segment is interleaved and has text"))?;
        let raw = segment.end - segment.data;
        if !raw.is_multiple_of(width) && !segment.unfinished {
            let text = format!("the segment has {raw} bytes of data in rows of {width}");
            return Err(Fault::new(segment.start, text));
        }
        let mut start = segment.data;
        for (i, chunk) in chunks {
            self.add(
                *i,
                chunk,
                segment,
                &Samples { start, count: raw / width, step: width, chunks: 1, chunk: 0 },
            );
            start += chunk.content.size().unwrap_or_default();
        }
        Ok(())
    }

    /// Data of which each chunk has the samples of one channel after those of another.
    fn place_contiguous(
        &mut self,
        segment: &LeadIn,
        chunks: &[(usize, Chunk)],
        whole: u64,
    ) -> Result<(), Fault> {
        let raw = segment.end - segment.data;
        let (chunks_there, rest) = (raw / whole, raw % whole);
        let mut start = segment.data;
        for (i, chunk) in chunks {
            let samples = Samples {
                start,
                count: chunk.count,
                step: chunk.content.size().unwrap_or_default(),
                chunks: chunks_there,
                chunk: whole,
            };
            self.add(*i, chunk, segment, &samples);
            // Beyond the end of the file only if no chunk is whole.
            start = start.saturating_add(chunk.bytes.unwrap_or_default());
        }
        if rest == 0 {
            return Ok(());
        }
        let mut start = segment.data + chunks_there * whole;
        for (i, chunk) in chunks {
            // Parts of text are not known.
            let step = chunk.content.size().unwrap_or_default();
            let count = match segment.unfinished {
                _ if step == 0 => 0,
                true => chunk.count.min((segment.end - start) / step),
                false => shorter(chunk.count, rest, whole).unwrap_or(0),
            };
            self.add(*i, chunk, segment, &Samples { start, count, step, chunks: 1, chunk: 0 });
            start += count * step;
            if segment.unfinished && count < chunk.count {
                return Ok(());
            }
        }
        if start != segment.end {
            let text = format!("the segment has {raw} bytes of data in chunks of {whole}");
            return Err(Fault::new(segment.start, text));
        }
        Ok(())
    }

    fn add(&mut self, object: usize, chunk: &Chunk, segment: &LeadIn, samples: &Samples) {
        let object = &mut self.all[object];
        let Content::Numbers(kind) = chunk.content else {
            object.refuse(&reason(chunk).unwrap_or_default());
            return;
        };
        let Samples { start, count, step, chunks, chunk } = *samples;
        if count > 0 && chunks > 0 {
            object.pieces.push(Piece { kind, big: segment.big, start, count, step, chunks, chunk });
        }
    }
}

/// The samples of a channel in the data of a segment.
struct Samples {
    start: u64,
    count: u64,
    step: u64,
    chunks: u64,
    chunk: u64,
}

/// Number of samples in a chunk of `rest` instead of `whole` bytes; `None` if it is not a whole number.
fn shorter(count: u64, rest: u64, whole: u64) -> Option<u64> {
    let product = u128::from(count) * u128::from(rest);
    (product % u128::from(whole) == 0).then(|| (product / u128::from(whole)) as u64)
}

fn reason(chunk: &Chunk) -> Option<String> {
    match chunk.content {
        Content::Numbers(_) => None,
        Content::Text => Some("holds text, which is not numbers".to_owned()),
        Content::Other(what, _) => Some(format!("holds {what}, which this reader does not take")),
    }
}

/// The names in a path such as `/'group'/'channel'`, in which a quotation mark stands twice; `None` if it is none.
fn names(path: &str) -> Option<Vec<String>> {
    if path == "/" {
        return Some(Vec::new());
    }
    let mut names = Vec::new();
    let mut rest = path;
    while !rest.is_empty() {
        rest = rest.strip_prefix("/'")?;
        let mut name = String::new();
        loop {
            let (before, after) = rest.split_once('\'')?;
            name.push_str(before);
            rest = after;
            let Some(after) = rest.strip_prefix('\'') else { break };
            name.push('\'');
            rest = after;
        }
        names.push(name);
    }
    (names.len() <= 2).then_some(names)
}

/// The path of names, unique for each.
fn path(names: &[String]) -> String {
    names.iter().map(|name| format!("/'{}'", name.replace('\'', "''"))).collect()
}

/// The beginning of a long text.
fn shortened(text: &str) -> String {
    const LONGEST: usize = 80;
    match text.char_indices().nth(LONGEST) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text.to_owned(),
    }
}
