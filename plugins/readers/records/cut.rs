//! From a dataset of several dimensions to single records.

use lacuna::plugin::reader::ReadError;

use super::REPLICATES;
use super::read::Reading;
use super::store::Array;
use crate::readers::listed;

/// A record in a dataset: the replicate's number, the index along each axis (0 on the numeric one), the samples.
pub(super) struct Record {
    pub replicate: usize,
    pub place: Vec<usize>,
    pub samples: Vec<f64>,
}

impl Reading<'_> {
    /// Cuts a dataset into records.
    pub(super) fn records(
        &self,
        name: &str,
        values: &Array,
        place: &[usize],
        single: bool,
    ) -> Result<Vec<Record>, ReadError> {
        if values.values.is_empty() {
            return Err(self.at(name, format!("has no numbers, its shape is {:?}", values.shape)));
        }
        let axes = &self.layout.axes;
        let written: Vec<&str> = if let Some(written) = &self.options.axes {
            written.iter().map(String::as_str).collect()
        } else {
            let own = self.inside.iter().copied().chain(self.grid.map(|(i, ..)| i));
            let mut own: Vec<usize> = own.collect();
            own.sort_unstable();
            let more = !single && values.squeezed(own.len() + 1).len() > own.len();
            let outer = more.then_some(REPLICATES);
            outer.into_iter().chain(own.iter().map(|&i| axes[i].name.as_str())).collect()
        };
        let shape = values.squeezed(written.len());
        if shape.len() != written.len() {
            let text = format!(
                "expected the dimensions {}, found the shape {:?}",
                listed(&written),
                values.shape
            );
            return Err(self.at(name, text).help("name the dimensions with `axes`"));
        }
        let positions: Vec<Option<usize>> =
            written.iter().map(|axis| self.layout.axis(axis).map(|(i, _)| i)).collect();
        for (axis, position) in written.iter().zip(&positions) {
            let known = match position {
                Some(i) => {
                    self.inside.contains(i) || self.grid.is_some_and(|(grid, ..)| grid == *i)
                }
                None => *axis == REPLICATES && !single,
            };
            if !known || written.iter().filter(|other| *other == axis).count() > 1 {
                let text = format!("`axes` has `{axis}`, which is no dimension of a dataset here");
                return Err(self.at(name, text));
            }
        }
        let labels = self.labels(name, &written, &shape, &positions)?;
        let along =
            self.grid.and_then(|(grid, ..)| positions.iter().position(|p| *p == Some(grid)));
        let length = along.map_or(1, |d| shape[d]);
        let count: usize =
            shape.iter().enumerate().filter(|(d, _)| Some(*d) != along).map(|(_, n)| n).product();
        if values.values.len() != count * length {
            let text =
                format!("has {} numbers for the shape {:?}", values.values.len(), values.shape);
            return Err(self.at(name, text));
        }
        let mut records = Vec::new();
        for number in 0..count {
            let mut rest = number;
            let mut record = Record { replicate: 0, place: place.to_vec(), samples: Vec::new() };
            let mut wanted = true;
            // Offset of the first sample, and stride of the next.
            let (mut offset, mut stride, mut along_stride) = (0, 1, 0);
            for d in (0..shape.len()).rev() {
                if Some(d) == along {
                    along_stride = stride;
                } else {
                    let i = rest % shape[d];
                    rest /= shape[d];
                    offset += i * stride;
                    match (positions[d], &labels[d]) {
                        (Some(axis), Some(of)) => match of[i] {
                            Some(label) => record.place[axis] = label,
                            None => wanted = false,
                        },
                        _ => record.replicate = i,
                    }
                }
                stride *= shape[d];
            }
            if wanted {
                record.samples =
                    (0..length).map(|k| values.values[offset + k * along_stride]).collect();
                records.push(record);
            }
        }
        Ok(records)
    }

    /// Index on the response's axis of each index along a dimension of labels; `None` for the other dimensions.
    fn labels(
        &self,
        name: &str,
        written: &[&str],
        shape: &[usize],
        positions: &[Option<usize>],
    ) -> Result<Vec<Option<Vec<Option<usize>>>>, ReadError> {
        let mut found = Vec::new();
        for (d, position) in positions.iter().enumerate() {
            let Some(position) = position.filter(|p| self.inside.contains(p)) else {
                found.push(None);
                continue;
            };
            let axis = &self.layout.axes[position];
            let given = self.options.labels.get(&axis.name);
            let labels = match given {
                Some(labels) => labels.clone(),
                None => (0..axis.len()).map(|i| axis.text(i)).collect(),
            };
            if labels.len() != shape[d] {
                let text = format!(
                    "expected {} values of `{}`, found {} along dimension {} of the shape {shape:?}",
                    labels.len(),
                    written[d],
                    shape[d],
                    d + 1
                );
                return Err(self
                    .at(name, text)
                    .help(format!("`labels.{}` lists those of the file", axis.name)));
            }
            let places: Vec<Option<usize>> = labels.iter().map(|l| axis.position(l)).collect();
            for i in 0..axis.len() {
                let count = places.iter().filter(|p| **p == Some(i)).count();
                if count != 1 {
                    let text =
                        format!("`labels.{}` has `{}` {count} times", axis.name, axis.text(i));
                    return Err(self.at(name, text));
                }
            }
            found.push(Some(places));
        }
        Ok(found)
    }
}
