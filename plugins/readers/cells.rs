//! Matching of texts and numbers in a file to values of the response: a sensor's label, a time on the grid.

use std::cell::OnceCell;
use std::collections::BTreeMap;

use lacuna::data::{Axis, Coordinates, Layout, Unit};
use lacuna::plugin::reader::ReadError;

use super::listed;
use super::sheet::{Conversion, Record, Sheet};

/// Largest distance of a coordinate from its grid value, as a fraction of the grid's smallest spacing: it allows for
/// digits that a file does not print, and for nothing else.
const CLOSE: f64 = 1e-4;

/// Relative difference below which two numbers are taken as the same number, computed in two ways.
const ROUNDING: f64 = 4.0 * f64::EPSILON;

/// Values of an axis by which the cells of a file are found.
pub struct Places<'a> {
    axis: &'a Axis,
    /// Smallest spacing of a grid; computed at the first number that is not exactly one of its values.
    spacing: OnceCell<f64>,
    /// Index of each label; made at the first label.
    labels: OnceCell<BTreeMap<&'a str, usize>>,
}

impl<'a> Places<'a> {
    /// Prepares the search on an axis.
    pub fn of(axis: &'a Axis) -> Self {
        Self { axis, spacing: OnceCell::new(), labels: OnceCell::new() }
    }

    /// Returns the index on the axis of a text from a file; `convert` changes its unit. The error describes the
    /// mismatch.
    pub fn place(&self, text: &str, convert: impl Fn(f64) -> Option<f64>) -> Result<usize, String> {
        let axis = self.axis;
        match &axis.coordinates {
            Coordinates::Labels(labels) => {
                let known = self.labels.get_or_init(|| {
                    // The first of equal labels is kept. Readers leave out the blanks about a text.
                    let all = || labels.iter().enumerate().rev();
                    let bare = all().map(|(i, label)| (label.trim(), i));
                    bare.chain(all().map(|(i, label)| (&label[..], i))).collect()
                });
                known.get(text).copied().ok_or_else(|| {
                    format!("unknown {} `{text}`; the response has {}", axis.name, listed(labels))
                })
            }
            Coordinates::Grid { values, unit } => {
                let x = text.parse().ok().filter(|x: &f64| x.is_finite()).and_then(convert);
                let x = x.ok_or_else(|| format!("expected a number, found `{text}`"))?;
                self.on_grid(values, x).ok_or_else(|| {
                    let (first, last) = (values.first(), values.last());
                    let (first, last) =
                        (first.copied().unwrap_or(0.0), last.copied().unwrap_or(0.0));
                    format!(
                        "{} {x} {unit} is not on the response's axis of {} values from {first} to {last} {unit}",
                        axis.name,
                        values.len()
                    )
                })
            }
        }
    }

    /// Returns the index of a number on a numeric axis; `None` if it is not on the grid.
    fn on_grid(&self, values: &[f64], x: f64) -> Option<usize> {
        let after = values.partition_point(|&v| v < x);
        let candidates = [after.checked_sub(1), Some(after)];
        let nearest = candidates
            .into_iter()
            .flatten()
            .filter(|&i| i < values.len())
            .min_by(|&a, &b| (values[a] - x).abs().total_cmp(&(values[b] - x).abs()))?;
        let distance = (values[nearest] - x).abs();
        if distance <= ROUNDING * x.abs() {
            return Some(nearest);
        }
        let spacing = *self
            .spacing
            .get_or_init(|| values.windows(2).map(|w| w[1] - w[0]).fold(f64::INFINITY, f64::min));
        let spacing = if spacing.is_finite() { spacing } else { values[nearest].abs() };
        (distance <= CLOSE * spacing).then_some(nearest)
    }
}

/// Columns of a long table that locate a value, and the column of the value.
pub struct LongColumns<'a> {
    layout: &'a Layout,
    places: Vec<Places<'a>>,
    axes: Vec<(usize, Option<Conversion>)>,
    /// Index of the response's column.
    pub value: usize,
    conversion: Conversion,
}

fn places(layout: &Layout) -> Vec<Places<'_>> {
    layout.axes.iter().map(Places::of).collect()
}

impl<'a> LongColumns<'a> {
    /// Finds the columns named like the axes and the response.
    pub fn find(sheet: &Sheet, layout: &'a Layout) -> Result<Self, ReadError> {
        let value = sheet
            .column(&layout.name)
            .and_then(|value| Ok((value, sheet.conversion(value, &layout.unit)?)));
        match (Self::axes(sheet, layout), value) {
            (Ok(axes), Ok((value, conversion))) => {
                Ok(Self { layout, places: places(layout), axes, value, conversion })
            }
            (axes, value) => Err(ReadError::of_all(axes.err().into_iter().chain(value.err()))
                .unwrap_or_else(|| ReadError::new(&sheet.path, "cannot be read"))),
        }
    }

    /// Finds only the columns that locate a value; `value` is the column of the value itself.
    pub fn places(sheet: &Sheet, layout: &'a Layout, value: usize) -> Result<Self, ReadError> {
        let conversion = Conversion::none(&layout.unit);
        let axes = Self::axes(sheet, layout)?;
        Ok(Self { layout, places: places(layout), axes, value, conversion })
    }

    fn axes(sheet: &Sheet, layout: &Layout) -> Result<Vec<(usize, Option<Conversion>)>, ReadError> {
        let mut wrong = Vec::new();
        let mut columns = Vec::with_capacity(layout.axes.len());
        for axis in &layout.axes {
            let found = sheet.column(&axis.name).and_then(|column| {
                let conversion = match &axis.coordinates {
                    Coordinates::Labels(_) => None,
                    Coordinates::Grid { unit, .. } => Some(sheet.conversion(column, unit)?),
                };
                Ok((column, conversion))
            });
            found.map_or_else(|error| wrong.push(error), |found| columns.push(found));
        }
        ReadError::of_all(wrong).map_or(Ok(columns), Err)
    }

    /// Returns the unit conversion of the values.
    pub fn conversion(&self) -> &Conversion {
        &self.conversion
    }

    /// Returns true if a column is one of these.
    pub fn has(&self, column: usize) -> bool {
        self.value == column || self.axes.iter().any(|(c, _)| *c == column)
    }

    /// Returns the flat index of a record's value in the layout.
    pub fn place(&self, sheet: &Sheet, record: &Record) -> Result<usize, ReadError> {
        let mut place = Vec::with_capacity(self.axes.len());
        for (axis, (column, conversion)) in self.places.iter().zip(&self.axes) {
            let convert = |x| conversion.as_ref().map_or(Some(x), |c| c.apply(x));
            let i = axis
                .place(&record.cells[*column], convert)
                .map_err(|text| sheet.complain(record, *column, text))?;
            place.push(i);
        }
        Ok(self.layout.index(&place))
    }

    /// Returns a record's value in the response's unit; `None` if it is missing.
    pub fn number(&self, sheet: &Sheet, record: &Record) -> Result<Option<f64>, ReadError> {
        Ok(sheet.number(record, self.value)?.and_then(|x| self.conversion.apply(x)))
    }
}

/// Converts the coordinates of a file's numeric axis to indices on the response's axis.
///
/// `numbers` are the coordinates in `unit`; without a unit they are taken to be in that of the axis.
pub fn grid_places(
    axis: &Axis,
    numbers: &[f64],
    unit: Option<&Unit>,
) -> Result<Vec<usize>, String> {
    let Coordinates::Grid { unit: to, .. } = &axis.coordinates else {
        return Err(format!("axis `{}` has labels, the file has numbers", axis.name));
    };
    let convert = |x: f64| unit.map_or(Some(x), |unit| unit.convert(x, to));
    if convert(1.0).is_none() {
        let unit = unit.map_or(String::new(), ToString::to_string);
        return Err(format!(
            "axis `{}` is in `{unit}`, which does not convert to `{to}`",
            axis.name
        ));
    }
    let places = Places::of(axis);
    numbers.iter().map(|x| places.place(&x.to_string(), convert)).collect()
}

/// Places of values that the headings of a wide table stand for.
pub struct Headings<'a> {
    layout: &'a Layout,
    places: Vec<Places<'a>>,
}

impl<'a> Headings<'a> {
    /// Prepares the search in a response.
    pub fn of(layout: &'a Layout) -> Self {
        Self { layout, places: places(layout) }
    }

    /// Returns the flat index that a heading stands for, such as `B 1e-5` or `B:1e-5`.
    pub fn place(&self, heading: &str) -> Result<usize, String> {
        let layout = self.layout;
        if layout.axes.is_empty() {
            let expected = &layout.name;
            return if heading == expected {
                Ok(0)
            } else {
                Err(format!("expected the column `{expected}`, found `{heading}`"))
            };
        }
        let parts: Vec<&str> = match layout.axes.len() {
            // With a single axis the heading is not split, because labels may contain blanks.
            1 => vec![heading],
            _ => heading.split([' ', ':', ';', '|', '@']).filter(|part| !part.is_empty()).collect(),
        };
        if parts.len() != layout.axes.len() {
            let axes: Vec<String> = layout.axes.iter().map(example).collect();
            return Err(format!("expected a heading like `{}`, found `{heading}`", axes.join(" ")));
        }
        let places = self.places.iter().zip(parts).map(|(axis, part)| axis.place(part, Some));
        Ok(layout.index(&places.collect::<Result<Vec<_>, _>>()?))
    }
}

fn example(axis: &Axis) -> String {
    match &axis.coordinates {
        _ if axis.is_empty() => axis.name.clone(),
        Coordinates::Labels(labels) => labels[0].clone(),
        Coordinates::Grid { values, .. } => format!("{:e}", values[0]),
    }
}
