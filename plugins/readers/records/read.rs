//! From the arrays of one file to replicates on the layout of the response.

use std::path::Path;

use lacuna::data::{Axis, Coordinates, Layout, Replicate, Unit};
use lacuna::plugin::reader::ReadError;

use super::Records;
use super::place::{Placed, Resample, place};
use super::store::{Array, REPLICATE, Rate, Store, array, by_number, captured};
use crate::readers::listed;

/// The replicates of a file.
pub(super) struct Read {
    pub replicates: Vec<Replicate>,
    /// True for each value of the layout that a record reaches, even if the value is missing.
    pub reached: Vec<bool>,
}

/// A file, the options of its reading, and the layout to which it is read.
pub(super) struct Reading<'a> {
    pub options: &'a Records,
    pub store: &'a dyn Store,
    pub layout: &'a Layout,
    /// Position and axis of the numeric axis.
    pub grid: Option<(usize, &'a Axis, &'a Unit)>,
    /// Label axes along dimensions of a dataset, in the order of the layout.
    pub inside: Vec<usize>,
    /// Label axes in the name of a dataset.
    pub named: Vec<usize>,
    pub pattern: &'a str,
}

impl<'a> Reading<'a> {
    pub fn new(
        options: &'a Records,
        store: &'a dyn Store,
        layout: &'a Layout,
    ) -> Result<Self, ReadError> {
        let pattern = options.dataset.as_deref().unwrap_or(&layout.name);
        let mut grid = None;
        let (mut inside, mut named) = (Vec::new(), Vec::new());
        for (i, axis) in layout.axes.iter().enumerate() {
            match &axis.coordinates {
                Coordinates::Grid { unit, .. } if grid.is_none() => grid = Some((i, axis, unit)),
                Coordinates::Grid { .. } => {
                    let text =
                        format!("`{}` has a second numeric axis `{}`", layout.name, axis.name);
                    return Err(ReadError::new(store.path(), text));
                }
                Coordinates::Labels(_) if pattern.contains(&format!("{{{}}}", axis.name)) => {
                    named.push(i);
                }
                Coordinates::Labels(_) => inside.push(i),
            }
        }
        Ok(Self { options, store, layout, grid, inside, named, pattern })
    }

    /// Reads all replicates.
    pub fn replicates(&self) -> Result<Read, ReadError> {
        let mut read = Read { replicates: Vec::new(), reached: vec![false; self.layout.len()] };
        let names = self.names()?;
        if let Some(names) = names {
            for name in names {
                let blank = vec![None; self.layout.len()];
                read.replicates.push(Replicate::new(name.as_str(), blank));
                self.part(&mut read, Some(&name))?;
            }
        } else {
            self.part(&mut read, None)?;
        }
        Ok(read)
    }

    /// Names of replicates in the names of datasets; `None` if they are not there.
    fn names(&self) -> Result<Option<Vec<String>>, ReadError> {
        if !self.pattern.contains(REPLICATE) {
            return Ok(None);
        }
        let mut names: Vec<String> = Vec::new();
        for place in self.places() {
            let pattern = self.filled(self.pattern, &place);
            names.extend(self.store.names().iter().filter_map(|name| captured(&pattern, name)));
        }
        names.sort_by(|a, b| by_number(a, b));
        names.dedup();
        if names.is_empty() {
            let text =
                format!("has no dataset `{}`; it has {}", self.pattern, listed(self.store.names()));
            return Err(self.complain(text));
        }
        Ok(Some(names))
    }

    /// Places of the datasets: index along each axis, 0 on those that are dimensions.
    fn places(&self) -> Vec<Vec<usize>> {
        let mut places = vec![vec![0; self.layout.axes.len()]];
        for &axis in &self.named {
            let with = |place: &Vec<usize>, i: usize| {
                let mut place = place.clone();
                place[axis] = i;
                place
            };
            let count = self.layout.axes[axis].len();
            places = places.iter().flat_map(|p| (0..count).map(move |i| with(p, i))).collect();
        }
        places
    }

    fn filled(&self, pattern: &str, place: &[usize]) -> String {
        self.named.iter().fold(pattern.to_owned(), |text, &i| {
            let axis = &self.layout.axes[i];
            text.replace(&format!("{{{}}}", axis.name), &axis.text(place[i]))
        })
    }

    /// Reads the datasets of one named replicate, or those without a replicate's name.
    fn part(&self, read: &mut Read, replicate: Option<&str>) -> Result<(), ReadError> {
        let named = |text: String| replicate.map_or(text.clone(), |r| text.replace(REPLICATE, r));
        let mut any = false;
        for place in self.places() {
            let name = named(self.filled(self.pattern, &place));
            // A replicate may lack a channel; one that no replicate has is found at the end.
            if replicate.is_some() && !self.store.names().contains(&name) {
                continue;
            }
            let values = array(self.store, &name)?;
            let records = self.records(&name, &values, &place, replicate.is_some())?;
            let count = records.iter().map(|record| record.replicate + 1).max().unwrap_or(0);
            if replicate.is_none() {
                if any && count != read.replicates.len() {
                    let text = format!("has {count} replicates, others {}", read.replicates.len());
                    return Err(self.at(&name, text));
                }
                let blank = || vec![None; self.layout.len()];
                for r in read.replicates.len()..count {
                    read.replicates.push(Replicate::new((r + 1).to_string(), blank()));
                }
            }
            any = true;
            let times = match self.grid {
                None => None,
                Some((_, _, unit)) => {
                    let time = self.options.time.as_ref();
                    let time = time.map(|text| named(self.filled(text, &place)));
                    let length = records.first().map_or(0, |record| record.samples.len());
                    Some(self.times(time.as_deref(), &name, count, length, unit)?)
                }
            };
            let own = self.options.unit.as_ref();
            let shape = values.shape.clone();
            for record in records {
                let samples = Array {
                    shape: shape.clone(),
                    values: record.samples,
                    unit: values.unit.clone(),
                };
                let samples = converted(self.store.path(), &name, samples, own, &self.layout.unit)?;
                if let Some(y) = samples.iter().find(|y| y.is_infinite()) {
                    return Err(self.at(&name, format!("holds {y}")));
                }
                let number = replicate.map_or(record.replicate, |_| read.replicates.len() - 1);
                let times = times.as_ref().map(|t| t[record.replicate % t.len()].as_slice());
                let times = self.aligned(times, record.replicate, count, &named)?;
                self.put(read, number, &record.place, times.as_deref(), &samples)
                    .map_err(|text| self.at(&name, text))?;
            }
        }
        Ok(())
    }

    /// Times of the records in the unit of the axis: one list for all, or one for each stacked replicate.
    fn times(
        &self,
        time: Option<&str>,
        dataset: &str,
        replicates: usize,
        length: usize,
        unit: &Unit,
    ) -> Result<Vec<Vec<f64>>, ReadError> {
        let own = self.options.time_unit.as_ref();
        let Some(time) = time else {
            let Rate { first, step, unit: stated } = self.rate(dataset)?;
            let values = (0..length).map(|n| first + n as f64 * step).collect();
            let array = Array { shape: vec![length], values, unit: stated };
            return Ok(vec![converted(self.store.path(), dataset, array, own, unit)?]);
        };
        let array = array(self.store, time)?;
        let shape = array.squeezed(1);
        let whole = array.shape.clone();
        let values = converted(self.store.path(), time, array, own, unit)?;
        if shape == [length] {
            return Ok(vec![values]);
        }
        if shape == [replicates, length] {
            return Ok(values.chunks(length.max(1)).map(<[f64]>::to_vec).collect());
        }
        let text = format!(
            "expected {length} times, as many as samples of `{dataset}`, found the shape {whole:?}"
        );
        Err(self.at(time, text))
    }

    /// First time and interval of a dataset: those of the options, else those of the file.
    fn rate(&self, dataset: &str) -> Result<Rate, ReadError> {
        if let Some(step) = self.options.step {
            let first = self.options.first.unwrap_or(0.0);
            return Ok(Rate { first, step, unit: None });
        }
        self.store.rate(dataset).ok_or_else(|| {
            let text = "has no times in the file, and the options state neither `time` nor `step`";
            self.at(dataset, text)
        })
    }

    /// Times relative to the trigger.
    fn aligned(
        &self,
        times: Option<&[f64]>,
        replicate: usize,
        replicates: usize,
        named: &impl Fn(String) -> String,
    ) -> Result<Option<Vec<f64>>, ReadError> {
        let Some(times) = times else { return Ok(None) };
        let Some(trigger) = &self.options.trigger else { return Ok(Some(times.to_vec())) };
        let name = named(trigger.channel.clone());
        let channel = array(self.store, &name)?;
        let length = times.len();
        let shape = channel.squeezed(1);
        let own = if shape == [length] {
            &channel.values[..]
        } else if shape == [replicates, length] {
            &channel.values[replicate * length..(replicate + 1) * length]
        } else {
            let text = format!(
                "expected {length} samples, as many as times, found the shape {:?}",
                channel.shape
            );
            return Err(self.at(&name, text));
        };
        let crossing = trigger.crossing(times, own).map_err(|text| {
            let text =
                if replicates > 1 { format!("replicate {}: {text}", replicate + 1) } else { text };
            self.at(&name, text)
        })?;
        Ok(Some(times.iter().map(|t| t - crossing + trigger.at).collect()))
    }

    fn put(
        &self,
        read: &mut Read,
        number: usize,
        at: &[usize],
        times: Option<&[f64]>,
        samples: &[f64],
    ) -> Result<(), String> {
        let (Some((grid, axis, _)), Some(times)) = (self.grid, times) else {
            let flat = self.layout.index(at);
            read.reached[flat] = true;
            read.replicates[number].values[flat] = Some(samples[0]).filter(|y| !y.is_nan());
            return Ok(());
        };
        let how: Resample = self.options.resample;
        let Placed { values, reached } = place(axis, times, samples, how).map_err(|text| {
            let hint = if how == Resample::Exact { "; `resample` takes other times" } else { "" };
            format!("{text}{hint}")
        })?;
        let mut at = at.to_vec();
        for (i, (value, reached)) in values.into_iter().zip(reached).enumerate() {
            at[grid] = i;
            let flat = self.layout.index(&at);
            read.reached[flat] |= reached;
            read.replicates[number].values[flat] = value;
        }
        Ok(())
    }

    fn complain(&self, text: impl Into<String>) -> ReadError {
        ReadError::new(self.store.path(), text)
    }

    pub fn at(&self, dataset: &str, text: impl Into<String>) -> ReadError {
        self.complain(text).at(format!("dataset `{dataset}`"))
    }
}

/// The numbers of a dataset in the unit `to`: from the unit `own` of the options, else from that of the file.
pub(super) fn converted(
    path: &Path,
    name: &str,
    array: Array,
    own: Option<&Unit>,
    to: &Unit,
) -> Result<Vec<f64>, ReadError> {
    let complain = |text: String| ReadError::new(path, text).at(format!("dataset `{name}`"));
    let stated = match (own, &array.unit) {
        (Some(unit), _) => Some(unit.clone()),
        (None, Some(text)) => Some(Unit::parse(text).map_err(|e| {
            complain(format!("its unit `{text}` is not known: {e}"))
                .help("state it with `unit` or `time_unit`")
        })?),
        (None, None) => None,
    };
    let Some(from) = stated else { return Ok(array.values) };
    let convert = |x: f64| {
        from.convert(x, to)
            .ok_or_else(|| complain(format!("is in `{from}`, which does not convert to `{to}`")))
    };
    array.values.into_iter().map(convert).collect()
}
