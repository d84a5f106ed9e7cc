//! Arrangement of the data in the file: on the axes if nothing is missing, otherwise concatenated.

use lacuna::data::{Coordinates, Measurements, Observations};
use netcdf_writer::{DimensionId, Error, VariableId};

use super::file::File;
use super::suffix;

/// Data of a study, in the order of the file: by block, by replicate, by output without the missing ones.
///
/// ArviZ needs a log-likelihood for every value present. Data of one block without missing values are variables on
/// `replicate` and the axes. All others are variables on `datum`, with coordinates `datum_replicate` and one per axis.
pub struct Cells<'a> {
    data: &'a Observations,
    complete: bool,
}

/// Dimensions of data in a group.
pub struct Place {
    /// Dimensions, slowest-varying first.
    pub dimensions: Vec<DimensionId>,
    /// Names of coordinates that are not dimensions.
    coordinates: String,
    /// Dimensions of each block: the replicates and the axes.
    blocks: Vec<Vec<DimensionId>>,
}

/// Largest number of data that are written: 80 MB.
const MOST: usize = 10_000_000;

/// Index of an axis in a layout, its values and their unit.
type Grid<'a> = (usize, &'a [f64], String);

impl Place {
    /// Dimensions of the axes of each block.
    pub fn axes(&self) -> Vec<Vec<DimensionId>> {
        // The first dimension is that of the replicates.
        self.blocks.iter().map(|block| block[1..].to_vec()).collect()
    }

    /// A variable on these dimensions, which follow `others`.
    pub fn variable(
        &self,
        file: &mut File,
        path: &str,
        before: &[DimensionId],
        values: &[f64],
        unit: Option<&str>,
    ) -> Result<VariableId, Error> {
        let dimensions = [before, &self.dimensions].concat();
        let variable = file.numbers(path, &dimensions, values, unit)?;
        if !self.coordinates.is_empty() {
            file.attribute(variable, "coordinates", &self.coordinates)?;
        }
        Ok(variable)
    }
}

impl<'a> Cells<'a> {
    /// The cells of the data of a likelihood.
    pub fn of(data: &'a Observations) -> Self {
        let block = |b: &Measurements| b.replicates.len() * b.layout.len();
        let complete = data.blocks.len() == 1 && data.count() == block(&data.blocks[0]);
        Self { data, complete }
    }

    /// Returns true if the data are too many to be written.
    pub fn are_many(&self) -> bool {
        self.data.count() > MOST
    }

    /// Writes the axes of each block into a group.
    pub fn axes(&self, file: &mut File, group: &str) -> Result<Vec<Vec<DimensionId>>, Error> {
        let blocks = self.data.blocks.iter().enumerate();
        let of = |(b, block): (usize, &Measurements)| {
            file.axes(group, &block.layout, &suffix(b, self.data.blocks.len()))
        };
        blocks.map(of).collect()
    }

    /// All measured values, concatenated.
    pub fn values(&self) -> Vec<f64> {
        let blocks = self.data.blocks.iter();
        blocks
            .flat_map(|b| &b.replicates)
            .flat_map(|r| r.values.iter().flatten())
            .copied()
            .collect()
    }

    /// Replicate and output index of each value of a block.
    fn measured(block: &Measurements) -> impl Iterator<Item = (usize, usize)> {
        block.replicates.iter().enumerate().flat_map(|(r, replicate)| {
            (0..replicate.values.len())
                .filter(|&i| replicate.values[i].is_some())
                .map(move |i| (r, i))
        })
    }

    /// Writes the coordinates of the data into a group.
    pub fn place(&self, file: &mut File, group: &str) -> Result<Place, Error> {
        let mut blocks = Vec::new();
        for (b, block) in self.data.blocks.iter().enumerate() {
            let suffix = suffix(b, self.data.blocks.len());
            let names: Vec<String> = block.replicates.iter().map(|r| r.name.clone()).collect();
            let mut own = vec![file.labels(group, &format!("replicate{suffix}"), &names)?];
            own.extend(file.axes(group, &block.layout, &suffix)?);
            blocks.push(own);
        }
        if self.complete {
            let dimensions = blocks[0].clone();
            return Ok(Place { dimensions, coordinates: String::new(), blocks });
        }
        let (datum, coordinates) = self.flat(file, group)?;
        Ok(Place { dimensions: vec![datum], coordinates, blocks })
    }

    /// The dimension of concatenated values, with the names of its coordinates.
    fn flat(&self, file: &mut File, group: &str) -> Result<(DimensionId, String), Error> {
        let blocks = &self.data.blocks;
        let numbers: Vec<usize> = match &blocks[..] {
            [one] => Self::measured(one).map(|(r, i)| r * one.layout.len() + i).collect(),
            _ => (0..self.data.count()).collect(),
        };
        let (datum, variable) = file.counted(group, "datum", &numbers)?;
        if let [one] = &blocks[..] {
            // Compression by gathering of the CF conventions (8.2): the index among all replicates and outputs.
            let axes = one.layout.axes.iter().map(|axis| axis.name.as_str());
            let names: Vec<&str> = ["replicate"].into_iter().chain(axes).collect();
            file.attribute(variable, "compress", &names.join(" "))?;
        }
        let mut coordinates = vec!["datum_replicate".to_owned()];
        let name = |b: &Measurements, r: usize| b.replicates[r].name.clone();
        let all: Vec<String> =
            blocks.iter().flat_map(|b| Self::measured(b).map(move |(r, _)| name(b, r))).collect();
        file.texts(&format!("{group}/datum_replicate"), datum, &all)?;
        let mut axes: Vec<&str> = Vec::new();
        for axis in blocks.iter().flat_map(|block| &block.layout.axes) {
            if !axes.contains(&axis.name.as_str()) {
                axes.push(&axis.name);
            }
        }
        for axis in axes {
            let name = format!("datum_{axis}");
            self.along(file, &format!("{group}/{name}"), datum, axis)?;
            coordinates.push(name);
        }
        Ok((datum, coordinates.join(" ")))
    }

    /// Position of each value along an axis: a number if all blocks have numbers of the same unit there, otherwise a
    /// text.
    fn along(
        &self,
        file: &mut File,
        path: &str,
        datum: DimensionId,
        axis: &str,
    ) -> Result<(), Error> {
        let grids: Vec<Option<(usize, &[f64], String)>> = self
            .data
            .blocks
            .iter()
            .map(|block| {
                let (place, axis) = block.layout.axis(axis)?;
                match &axis.coordinates {
                    Coordinates::Grid { values, unit } => {
                        Some((place, &values[..], unit.to_string()))
                    }
                    Coordinates::Labels(_) => None,
                }
            })
            .collect();
        let cells = || {
            let blocks = self.data.blocks.iter().zip(&grids);
            blocks
                .flat_map(|(block, grid)| Self::measured(block).map(move |(_, i)| (block, grid, i)))
        };
        let unit = grids[0].as_ref().map(|(_, _, unit)| unit.clone());
        if let Some(unit) =
            unit.filter(|u| grids.iter().all(|g| g.as_ref().is_some_and(|g| g.2 == *u)))
        {
            let number = |(block, grid, i): (&Measurements, &Option<Grid<'_>>, usize)| {
                grid.as_ref()
                    .map_or(f64::NAN, |(place, grid, _)| grid[block.layout.place(i)[*place]])
            };
            let values: Vec<f64> = cells().map(number).collect();
            return file.numbers(path, &[datum], &values, Some(&unit)).map(|_| ());
        }
        let text = |(block, _, i): (&Measurements, &_, usize)| {
            let found = block.layout.axis(axis);
            found.map_or_else(String::new, |(place, axis)| axis.text(block.layout.place(i)[place]))
        };
        let texts: Vec<String> = cells().map(text).collect();
        file.texts(path, datum, &texts)
    }
}
