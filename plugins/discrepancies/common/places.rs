//! Values found by their index among all measured ones.

use lacuna::data::Measurements;

/// Index of the first value of each replicate, in the order by replicate and output without the missing ones, and the number
/// of all values.
#[derive(Debug, Clone)]
pub struct Places {
    first: Vec<usize>,
}

impl Places {
    /// Counts the values of the replicates.
    pub fn of(data: &Measurements) -> Self {
        let mut first = vec![0];
        let mut next = 0;
        for replicate in &data.replicates {
            next += replicate.values.iter().flatten().count();
            first.push(next);
        }
        Self { first }
    }

    /// Outputs and values of indices, which increase; those beyond the last value are omitted. A replicate is passed once.
    pub fn values(&self, data: &Measurements, indices: &[usize]) -> Vec<(usize, f64)> {
        let mut found = Vec::with_capacity(indices.len());
        let mut rest = indices;
        for (replicate, ends) in data.replicates.iter().zip(self.first.windows(2)) {
            let (first, end) = (ends[0], ends[1]);
            let count = rest.iter().take_while(|&&index| index < end).count();
            let (own, others) = rest.split_at(count);
            rest = others;
            let present = replicate.values.iter().enumerate();
            let mut present = present.filter_map(|(i, y)| Some((i, (*y)?)));
            let is_complete = end - first == replicate.values.len();
            let mut passed = first;
            for &index in own {
                if is_complete {
                    let place = index - first;
                    found.extend(replicate.values[place].map(|y| (place, y)));
                } else {
                    found.extend(present.nth(index - passed));
                    passed = index + 1;
                }
            }
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::discrepancies::common::{testing, values};

    #[test]
    fn every_value_has_its_place() {
        let mut data = testing::data(3, 5);
        data.replicates[2].values.fill(None);
        data.replicates[3].values[1] = None;
        let places = Places::of(&data);
        let all: Vec<(usize, f64)> = values(&data).collect();
        let indices: Vec<usize> = (0..all.len() + 3).collect();
        assert_eq!(places.values(&data, &indices), all);
        for index in &indices[..all.len()] {
            assert_eq!(places.values(&data, &[*index]), [all[*index]]);
        }
        let some: Vec<usize> = (0..all.len()).step_by(3).collect();
        let expected: Vec<(usize, f64)> = some.iter().map(|&i| all[i]).collect();
        assert_eq!(places.values(&data, &some), expected);
    }
}
