//! Positions of the values of a response: one per label and point of the numeric axes.

use lacuna::data::{Coordinates, Layout};

/// A layout as seen by the equations.
#[derive(Debug)]
pub struct Shape<'a> {
    /// Numeric axes: their coordinates and their strides in the response.
    grids: Vec<(&'a [f64], usize)>,
    /// Index of the observed quantity for each label of the layout.
    pub observed: Vec<usize>,
    /// Stride of the labels in the response.
    label_stride: usize,
}

impl<'a> Shape<'a> {
    /// Returns the shape of a layout for `variables` numeric axes and these labels; the error describes what does not
    /// fit.
    pub fn of(layout: &'a Layout, variables: usize, labels: &[String]) -> Result<Self, String> {
        let lengths = layout.shape();
        let mut shape = Self { grids: Vec::new(), observed: vec![0], label_stride: 0 };
        let mut label_axes = 0;
        for (i, axis) in layout.axes.iter().enumerate() {
            let stride = lengths[i + 1..].iter().product();
            match &axis.coordinates {
                Coordinates::Grid { values, .. } => shape.grids.push((values, stride)),
                Coordinates::Labels(asked) => {
                    label_axes += 1;
                    let index = |label: &String| labels.iter().position(|known| known == label);
                    let unknown = |label: &String| format!("nothing observes `{label}`");
                    let each = asked.iter().map(|label| index(label).ok_or_else(|| unknown(label)));
                    shape.observed = each.collect::<Result<_, String>>()?;
                    shape.label_stride = stride;
                }
            }
        }
        let expected = usize::from(labels != [""]);
        if label_axes != expected || shape.grids.len() != variables {
            let found = (label_axes, shape.grids.len());
            return Err(format!(
                "the response has {} axes of labels and {} of numbers where the equations have {expected} and {variables}",
                found.0, found.1
            ));
        }
        Ok(shape)
    }

    /// Returns the coordinates of the first numeric axis.
    pub fn times(&self) -> &'a [f64] {
        self.grids.first().map_or(&[], |grid| grid.0)
    }

    /// Returns the number of points of the numeric axes.
    pub fn points(&self) -> usize {
        self.grids.iter().map(|(values, _)| values.len()).product()
    }

    /// Writes the coordinates of a point, the last axis fastest, and returns its first position in the response.
    pub fn point(&self, index: usize, coordinates: &mut [f64]) -> usize {
        let (mut rest, mut place) = (index, 0);
        for ((values, stride), x) in self.grids.iter().zip(coordinates).rev() {
            let i = rest % values.len();
            rest /= values.len();
            *x = values[i];
            place += i * stride;
        }
        place
    }

    /// Iterates over the positions of the labels of a point, with the index of the observed quantity at each.
    pub fn places(&self, first: usize) -> impl Iterator<Item = (usize, usize)> + '_ {
        let stride = self.label_stride;
        self.observed.iter().enumerate().map(move |(i, observed)| (first + i * stride, *observed))
    }
}
