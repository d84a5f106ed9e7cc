//! Replicates, as the rows of a long table give their values one by one.

use std::collections::BTreeMap;

use lacuna::data::{Layout, Replicate};

/// Replicates in the order of their first rows.
pub(super) struct Gathered {
    outputs: usize,
    /// True if the table states the noise of its values.
    stated: bool,
    found: Vec<Rows>,
    /// Index of each replicate.
    order: BTreeMap<String, usize>,
    /// Index of the replicate of the row before.
    last: usize,
    /// True for each output that has a row.
    seen: Vec<bool>,
}

/// A replicate as its rows are read.
struct Rows {
    name: String,
    values: Vec<Option<f64>>,
    sd: Option<Vec<f64>>,
    lines: Lines,
}

impl Gathered {
    /// Of a table without rows, whose values have a standard deviation if `stated`.
    pub fn new(layout: &Layout, stated: bool) -> Self {
        let outputs = layout.len();
        let (found, order, seen) = (Vec::new(), BTreeMap::new(), vec![false; outputs]);
        Self { outputs, stated, found, order, last: 0, seen }
    }

    /// Adds a row: a value and its standard deviation at an output of a replicate.
    ///
    /// # Errors
    /// The line of the first row, if there is one already.
    pub fn add(
        &mut self,
        replicate: &str,
        output: usize,
        line: usize,
        (value, sd): (Option<f64>, Option<f64>),
    ) -> Result<(), usize> {
        let rows = self.rows(replicate);
        if let Some(first) = rows.lines.of(output) {
            return Err(first);
        }
        rows.lines.add(output, line, rows.values.len());
        rows.values[output] = value;
        if let (Some(all), Some(sd)) = (&mut rows.sd, sd) {
            all[output] = sd;
        }
        self.seen[output] = true;
        Ok(())
    }

    /// The rows of a replicate. Most tables have them one below the other.
    fn rows(&mut self, name: &str) -> &mut Rows {
        if self.found.get(self.last).is_none_or(|rows| rows.name != name) {
            self.last = if let Some(&known) = self.order.get(name) {
                known
            } else {
                self.order.insert(name.to_owned(), self.found.len());
                self.found.push(Rows {
                    name: name.to_owned(),
                    values: vec![None; self.outputs],
                    sd: self.stated.then(|| vec![0.0; self.outputs]),
                    lines: Lines::Even { first: 0, step: 0, count: 0 },
                });
                self.found.len() - 1
            };
        }
        &mut self.found[self.last]
    }

    /// True for each output that has a row, even one without a value.
    pub fn seen(&self) -> &[bool] {
        &self.seen
    }

    /// The replicates.
    pub fn replicates(self) -> Vec<Replicate> {
        let whole =
            |rows: Rows| Replicate { sd: rows.sd, ..Replicate::new(rows.name, rows.values) };
        self.found.into_iter().map(whole).collect()
    }
}

/// Lines of the rows of a replicate.
enum Lines {
    /// The first `count` outputs, in their order and in lines at equal distances.
    Even { first: usize, step: usize, count: usize },
    /// Line of each output; zero without a row.
    Each(Vec<usize>),
}

impl Lines {
    /// Line of an output; `None` if it has no row.
    fn of(&self, output: usize) -> Option<usize> {
        match self {
            Self::Even { first, step, count } => (output < *count).then(|| first + output * step),
            Self::Each(lines) => Some(lines[output]).filter(|&line| line > 0),
        }
    }

    /// Adds the line of a further one of all outputs.
    fn add(&mut self, output: usize, line: usize, outputs: usize) {
        if let Self::Even { first, step, count } = self
            && output == *count
        {
            match *count {
                0 => *first = line,
                1 => *step = line - *first,
                _ => {}
            }
            if line == *first + output * *step {
                *count += 1;
                return;
            }
        }
        if let Self::Even { count, .. } = *self {
            let mut lines = vec![0; outputs];
            (0..count).for_each(|i| lines[i] = self.of(i).unwrap_or(0));
            *self = Self::Each(lines);
        }
        if let Self::Each(lines) = self {
            lines[output] = line;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows in any order, with any distances, compared with a list of all.
    #[test]
    fn the_line_of_each_output_is_known() {
        for rows in [
            vec![(0, 2), (1, 3), (2, 4), (3, 5)],
            vec![(0, 2), (1, 5), (2, 8), (3, 11)],
            vec![(0, 2), (1, 3), (2, 5), (3, 6)],
            vec![(3, 2), (1, 3), (0, 4)],
            vec![(0, 7), (2, 8), (1, 9)],
            vec![(0, 7)],
        ] {
            let mut lines = Lines::Even { first: 0, step: 0, count: 0 };
            let mut known = [None; 4];
            for (output, line) in rows {
                assert_eq!(lines.of(output), None);
                lines.add(output, line, 4);
                known[output] = Some(line);
                assert_eq!([0, 1, 2, 3].map(|i| lines.of(i)), known);
            }
        }
    }
}
