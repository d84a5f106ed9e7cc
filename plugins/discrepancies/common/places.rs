//! Values found by their index among all measured ones.

use lacuna::data::Measurements;

/// Index of the first value of each replicate, in the order by replicate and output without the missing ones.
#[derive(Debug, Clone)]
pub struct Places {
    first: Vec<usize>,
}

impl Places {
    /// Counts the values of the replicates.
    pub fn of(data: &Measurements) -> Self {
        let mut next = 0;
        let first = |values: &[Option<f64>]| {
            let first = next;
            next += values.iter().flatten().count();
            first
        };
        let replicates = data.replicates.iter().map(|replicate| &replicate.values[..]);
        Self { first: replicates.map(first).collect() }
    }

    /// Output and value of an index; `None` if there are not as many.
    pub fn value(&self, data: &Measurements, index: usize) -> Option<(usize, f64)> {
        let replicate = self.first.partition_point(|&first| first <= index).checked_sub(1)?;
        let values = &data.replicates[replicate].values;
        let place = index - self.first[replicate];
        let next = self.first.get(replicate + 1);
        if next.is_some_and(|next| next - self.first[replicate] == values.len()) {
            return Some((place, values[place]?));
        }
        values.iter().enumerate().filter_map(|(i, y)| Some((i, (*y)?))).nth(place)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::discrepancies::common::{testing, values};

    #[test]
    fn every_value_has_its_place() {
        let mut data = testing::data(3, 5);
        data.replicates[2].values.fill(None);
        data.replicates[3].values[1] = None;
        let places = Places::of(&data);
        let all: Vec<(usize, f64)> = values(&data).collect();
        let found: Vec<(usize, f64)> =
            (0..all.len()).map(|k| places.value(&data, k).unwrap()).collect();
        assert_eq!(found, all);
        assert_eq!(places.value(&data, all.len()), None);
    }
}
