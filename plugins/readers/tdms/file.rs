//! A TDMS file as named arrays.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use lacuna::plugin::reader::ReadError;

use super::bytes::{Bytes, Fault};
use super::channels::{Known, Objects};
use super::kind::{Kind, Property, moment, seconds};
use super::metadata::{self, INDEX_TAG, LEAD_IN, LeadIn, METADATA, NEW_LIST};
use super::pieces::{self, Piece};
use super::scale;
use crate::readers::contents::fact;
use crate::readers::records::store::{Array, Rate, Store};

/// An open file, of which the metadata are in memory.
pub(super) struct File {
    path: PathBuf,
    content: fs::File,
    objects: Objects,
    /// Numbers of the channels among the objects, and names `group/channel`.
    channels: Vec<usize>,
    names: Vec<String>,
    notes: Vec<String>,
}

impl File {
    /// Opens a file and reads the metadata of all its segments.
    pub fn open(path: &Path) -> Result<Self, ReadError> {
        let broken = |e: io::Error| ReadError::new(path, format!("cannot be read: {e}"));
        let content = fs::File::open(path)
            .map_err(|e| ReadError::new(path, format!("cannot be opened: {e}")))?;
        let length = content.metadata().map_err(broken)?.len();
        let mut file = Self {
            path: path.to_owned(),
            content,
            objects: Objects::default(),
            channels: Vec::new(),
            names: Vec::new(),
            notes: Vec::new(),
        };
        if length == 0 {
            return Err(ReadError::new(path, "is empty"));
        }
        let mut start = 0;
        while start < length {
            let count = LEAD_IN.min(length - start);
            let bytes = pieces::part(&file.content, start, count).map_err(broken)?;
            if bytes.starts_with(INDEX_TAG) {
                let text = "is the index of a TDMS file, which has no data";
                return Err(ReadError::new(path, text).help("name the file `.tdms` beside it"));
            }
            let segment = LeadIn::read(&bytes, start, length).map_err(|f| f.of(path))?;
            let Some(segment) = segment else {
                file.notes.push("the last segment has no complete metadata".to_owned());
                break;
            };
            if segment.unfinished {
                file.notes.push("the last segment was not finished: its samples are read".into());
            }
            let size = if segment.has(METADATA) { segment.data - start - LEAD_IN } else { 0 };
            let bytes = pieces::part(&file.content, start + LEAD_IN, size).map_err(broken)?;
            file.segment(&segment, &bytes).map_err(|f| f.of(path))?;
            start = segment.end;
        }
        file.list_channels();
        Ok(file)
    }

    fn segment(&mut self, segment: &LeadIn, bytes: &[u8]) -> Result<(), Fault> {
        let objects = &mut self.objects;
        if segment.has(METADATA) {
            if segment.has(NEW_LIST) {
                objects.clear_list();
            }
            let mut bytes = Bytes::new(bytes, segment.start + LEAD_IN, segment.big);
            metadata::objects(&mut bytes, |object| objects.take(object))?;
        }
        objects.place(segment)
    }

    fn list_channels(&mut self) {
        for (i, object) in self.objects.all.iter().enumerate() {
            if let [group, channel] = &object.names[..] {
                self.channels.push(i);
                self.names.push(format!("{group}/{channel}"));
            }
        }
    }

    fn channel(&self, name: &str) -> Result<&Known, ReadError> {
        let mut found = self.names.iter().zip(&self.channels).filter(|(own, _)| *own == name);
        match (found.next(), found.next()) {
            (Some((_, &i)), None) => Ok(&self.objects.all[i]),
            (None, _) => Err(self.at(name, "is not in the file")),
            _ => Err(self.at(name, "is the name of two channels, whose groups differ by a `/`")),
        }
    }

    fn at(&self, channel: &str, text: impl Into<String>) -> ReadError {
        ReadError::new(&self.path, text).at(format!("channel `{channel}`"))
    }

    /// The numbers of a channel as they are stored; of moments, the seconds since the first.
    fn stored(&self, pieces: &[Piece], is_time: bool) -> io::Result<Vec<f64>> {
        // Each sample has a byte at least, and all are inside of the file.
        let count: u64 = pieces.iter().map(Piece::len).sum();
        let mut values = Vec::with_capacity(count as usize);
        let mut first = None;
        pieces::each(&self.content, pieces, |piece, bytes| {
            values.push(if is_time {
                // Exact: in seconds since 1904, a number has a resolution of half a microsecond.
                let time = moment(bytes, piece.big);
                seconds(time.wrapping_sub(*first.get_or_insert(time)))
            } else {
                piece.kind.number(bytes, piece.big)
            });
        })?;
        Ok(values)
    }
}

fn text(channel: &Known, property: &str) -> Option<String> {
    match channel.properties.get(property) {
        Some(Property::Text(text)) => Some(text.trim().to_owned()).filter(|text| !text.is_empty()),
        _ => None,
    }
}

fn number(channel: &Known, property: &str) -> Option<f64> {
    match channel.properties.get(property) {
        Some(Property::Number(x)) => Some(*x),
        _ => None,
    }
}

impl Store for File {
    fn path(&self) -> &Path {
        &self.path
    }

    fn format(&self) -> String {
        "TDMS".to_owned()
    }

    fn names(&self) -> &[String] {
        &self.names
    }

    fn array(&self, name: &str) -> Result<Array, ReadError> {
        let channel = self.channel(name)?;
        if let Some(reason) = &channel.refused {
            return Err(self.at(name, reason));
        }
        let times = channel.pieces.iter().filter(|piece| piece.kind == Kind::Time).count();
        if times != 0 && times != channel.pieces.len() {
            return Err(self.at(name, "holds moments in some segments, and numbers in others"));
        }
        let is_time = times > 0;
        let mut values = self
            .stored(&channel.pieces, is_time)
            .map_err(|e| self.at(name, format!("cannot be read: {e}")))?;
        if is_time {
            let unit = Some("s".to_owned());
            return Ok(Array { shape: vec![values.len()], values, unit });
        }
        let above = [&channel.names[..1], &[]];
        let above = above.iter().filter_map(|names| self.objects.find(names));
        let levels: Vec<_> =
            std::iter::once(channel).chain(above).map(|object| &object.properties).collect();
        let scales = scale::scales(&levels).map_err(|reason| self.at(name, reason))?;
        if !scales.is_empty() {
            for x in &mut values {
                *x = scale::scaled(&scales, *x);
            }
        }
        Ok(Array { shape: vec![values.len()], values, unit: text(channel, "unit_string") })
    }

    fn rate(&self, name: &str) -> Option<Rate> {
        let channel = self.channel(name).ok()?;
        let step = number(channel, "wf_increment").filter(|x| x.is_finite() && *x > 0.0)?;
        let first = number(channel, "wf_start_offset").unwrap_or(0.0);
        let unit = text(channel, "wf_xunit_string").unwrap_or_else(|| "s".to_owned());
        first.is_finite().then_some(Rate { first, step, unit: Some(unit) })
    }

    fn facts(&self) -> Vec<(String, String)> {
        let rates = self.names.iter().filter_map(|name| {
            let Rate { first, step, unit } = self.rate(name)?;
            let unit = unit.unwrap_or_default();
            Some(fact(
                &format!("times of {name}"),
                format!("from {first} {unit}, every {step} {unit}"),
            ))
        });
        self.notes.iter().map(|note| fact("note", note)).chain(rates).collect()
    }
}
