//! Joint likelihood of several blocks of scenarios: the product of their likelihoods.

use std::ops::Range;

use lacuna::data::measurements::Summary;
use lacuna::data::{Layouts, Measurements};
use lacuna::math::random::Stream;
use lacuna::plugin::discrepancy::{Compressed, ErrorPath, SampledErrors, VariancePart};
use lacuna::plugin::forward::Linear;
use lacuna::plugin::{Fact, Hyperparameter, Likelihood};
use lacuna_linalg::Matrix;

/// Likelihoods of blocks that are independent given their unknowns. Hyperparameters with the same name are one unknown,
/// with the prior of the first block that has it.
pub struct Joint {
    blocks: Vec<Block>,
    hyper: Vec<Hyperparameter>,
}

struct Block {
    likelihood: Box<dyn Likelihood>,
    outputs: Range<usize>,
    /// Index of each hyperparameter of the block among all.
    places: Vec<usize>,
}

impl Block {
    fn own(&self, hyper: &[f64]) -> Vec<f64> {
        self.places.iter().map(|&place| hyper[place]).collect()
    }
}

/// Adds the values of a block's hyperparameters at their indices among all.
fn scatter(places: &[usize], values: &[f64], all: &mut [f64]) {
    places.iter().zip(values).for_each(|(&place, value)| all[place] += value);
}

impl Joint {
    /// The product of one likelihood per block.
    pub fn new(layouts: &Layouts, likelihoods: Vec<Box<dyn Likelihood>>) -> Self {
        let mut hyper: Vec<Hyperparameter> = Vec::new();
        let mut blocks = Vec::new();
        for (likelihood, outputs) in likelihoods.into_iter().zip(layouts.ranges()) {
            let place = |own: &Hyperparameter| {
                let known = hyper.iter().position(|other| other.name == own.name);
                known.unwrap_or_else(|| {
                    hyper.push(own.clone());
                    hyper.len() - 1
                })
            };
            let places = likelihood.hyperparameters().iter().map(place).collect();
            blocks.push(Block { likelihood, outputs, places });
        }
        Self { blocks, hyper }
    }

    /// The same likelihood with further unknowns, behind all others, on which it does not depend.
    #[must_use]
    pub fn with_besides(mut self, unknowns: Vec<Hyperparameter>) -> Self {
        self.hyper.extend(unknowns);
        self
    }
}

impl Joint {
    /// Puts the errors of the blocks together, by origin; those that a block does not have are zero there.
    fn merged(&self, drawn: impl Iterator<Item = Vec<ErrorPath>>) -> Vec<ErrorPath> {
        let outputs = self.blocks.last().map_or(0, |block| block.outputs.end);
        let mut all: Vec<ErrorPath> = Vec::new();
        for (block, paths) in self.blocks.iter().zip(drawn) {
            for own in paths {
                let place = all.iter().position(|other| other.origin == own.origin);
                let place = place.unwrap_or_else(|| {
                    all.push(ErrorPath { origin: own.origin.clone(), values: vec![0.0; outputs] });
                    all.len() - 1
                });
                all[place].values[block.outputs.clone()].copy_from_slice(&own.values);
            }
        }
        all
    }
}

impl Likelihood for Joint {
    fn hyperparameters(&self) -> &[Hyperparameter] {
        &self.hyper
    }

    fn log_likelihood(&self, response: &[f64], hyper: &[f64]) -> f64 {
        let one = |block: &Block| {
            block.likelihood.log_likelihood(&response[block.outputs.clone()], &block.own(hyper))
        };
        self.blocks.iter().map(one).sum()
    }

    /// The largest number of runs of any block; a block uses as many of them as it needs.
    fn runs(&self) -> usize {
        self.blocks.iter().map(|block| block.likelihood.runs()).max().unwrap_or(1)
    }

    fn log_estimate(&self, runs: &Matrix, hyper: &[f64]) -> f64 {
        let one = |block: &Block| {
            let outputs: Vec<usize> = block.outputs.clone().collect();
            let own: Vec<usize> = (0..block.likelihood.runs()).collect();
            let part = runs.select_rows(&own).select_columns(&outputs);
            block.likelihood.log_estimate(&part, &block.own(hyper))
        };
        self.blocks.iter().map(one).sum()
    }

    fn log_likelihoods(&self, responses: &Matrix, hyper: &Matrix) -> Vec<f64> {
        // Starts from -0.0, like the sum at a single point, so that the bits agree.
        let mut sums = vec![-0.0; responses.rows()];
        for block in &self.blocks {
            let outputs: Vec<usize> = block.outputs.clone().collect();
            let (part, own) =
                (responses.select_columns(&outputs), hyper.select_columns(&block.places));
            let values = block.likelihood.log_likelihoods(&part, &own);
            sums.iter_mut().zip(values).for_each(|(sum, value)| *sum += value);
        }
        sums
    }

    fn failure(&self) -> Option<String> {
        self.blocks.iter().find_map(|block| block.likelihood.failure())
    }

    fn left_out(&self, response: &[f64], hyper: &[f64]) -> Option<Vec<f64>> {
        let one = |block: &Block| {
            block.likelihood.left_out(&response[block.outputs.clone()], &block.own(hyper))
        };
        Some(self.blocks.iter().map(one).collect::<Option<Vec<_>>>()?.concat())
    }

    fn left_out_at(&self, response: &[f64], hyper: &[f64], data: &[usize]) -> Option<Vec<f64>> {
        if let [block] = &self.blocks[..] {
            return block.likelihood.left_out_at(response, &block.own(hyper), data);
        }
        let all = self.left_out(response, hyper)?;
        data.iter().map(|&i| all.get(i).copied()).collect()
    }

    /// The blocks share none of the sampled errors.
    fn sampled_errors(&self, hyper: &[f64]) -> Option<SampledErrors> {
        let of = |block: &Block| block.likelihood.sampled_errors(&block.own(hyper));
        let all = self.blocks.iter().map(of).collect::<Option<Vec<_>>>()?;
        Some(SampledErrors {
            noise: all.iter().flat_map(|errors| errors.noise.iter().copied()).collect(),
            sampled: diagonal(all.iter().map(|errors| &errors.sampled)),
            left_out: diagonal(all.iter().map(|errors| &errors.left_out)),
        })
    }

    fn gradient(&self, response: &[f64], hyper: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let mut by_response = Vec::with_capacity(response.len());
        let mut by_hyper = vec![0.0; hyper.len()];
        for block in &self.blocks {
            let part = &response[block.outputs.clone()];
            let (slopes, own) = block.likelihood.gradient(part, &block.own(hyper));
            by_response.extend(slopes);
            scatter(&block.places, &own, &mut by_hyper);
        }
        (by_response, by_hyper)
    }

    fn is_cheap(&self) -> bool {
        self.blocks.iter().all(|block| block.likelihood.is_cheap())
    }

    fn compress(&self, linear: &dyn Linear) -> Option<Box<dyn Compressed>> {
        let parts: Option<Vec<_>> = self
            .blocks
            .iter()
            .map(|block| {
                let rows = Outputs::of(linear, block.outputs.clone());
                Some((block.likelihood.compress(&rows)?, block.places.clone()))
            })
            .collect();
        Some(Box::new(CompressedBlocks { parts: parts?, hyper: self.hyper.len() }))
    }

    fn predictive(&self, response: &[f64], hyper: &[f64]) -> Vec<VariancePart> {
        let outputs = self.blocks.last().map_or(0, |block| block.outputs.end);
        let mut all: Vec<VariancePart> = Vec::new();
        for block in &self.blocks {
            let part = &response[block.outputs.clone()];
            for own in block.likelihood.predictive(part, &block.own(hyper)) {
                let place = all.iter().position(|other| other.origin == own.origin);
                let place = place.unwrap_or_else(|| {
                    let variance = vec![0.0; outputs];
                    all.push(VariancePart { origin: own.origin.clone(), variance });
                    all.len() - 1
                });
                all[place].variance[block.outputs.clone()].copy_from_slice(&own.variance);
            }
        }
        all
    }

    /// The errors of the blocks are independent of each other.
    fn errors(&self, response: &[f64], hyper: &[f64], stream: &Stream) -> Vec<ErrorPath> {
        let drawn = |(i, block): (usize, &Block)| {
            let part = &response[block.outputs.clone()];
            block.likelihood.errors(part, &block.own(hyper), &stream.at(i as u64))
        };
        self.merged(self.blocks.iter().enumerate().map(drawn))
    }

    /// Blocks without such a form have their plain errors.
    fn errors_given_data(
        &self,
        response: &[f64],
        hyper: &[f64],
        stream: &Stream,
    ) -> Option<Vec<ErrorPath>> {
        let drawn = |(i, block): (usize, &Block)| {
            let (part, own) = (&response[block.outputs.clone()], block.own(hyper));
            let (likelihood, stream) = (&block.likelihood, stream.at(i as u64));
            likelihood
                .errors_given_data(part, &own, &stream)
                .unwrap_or_else(|| likelihood.errors(part, &own, &stream))
        };
        Some(self.merged(self.blocks.iter().enumerate().map(drawn)))
    }

    fn simulate(&self, response: &[f64], hyper: &[f64], stream: &Stream) -> Vec<Measurements> {
        let one = |(i, block): (usize, &Block)| {
            let part = &response[block.outputs.clone()];
            block.likelihood.simulate(part, &block.own(hyper), &stream.at(i as u64))
        };
        self.blocks.iter().enumerate().flat_map(one).collect()
    }

    fn simulate_summaries(
        &self,
        response: &[f64],
        hyper: &[f64],
        stream: &Stream,
    ) -> Option<Vec<Vec<Summary>>> {
        let one = |(i, block): (usize, &Block)| {
            let (part, own) = (&response[block.outputs.clone()], block.own(hyper));
            block.likelihood.simulate_summaries(part, &own, &stream.at(i as u64))
        };
        let all: Option<Vec<_>> = self.blocks.iter().enumerate().map(one).collect();
        all.map(|all| all.concat())
    }

    fn facts(&self) -> Vec<Fact> {
        if let [block] = &self.blocks[..] {
            return block.likelihood.facts();
        }
        let mut facts = vec![Fact::new("blocks of scenarios with equal axes", self.blocks.len())];
        for (i, block) in self.blocks.iter().enumerate() {
            let numbered =
                |fact: Fact| Fact { name: format!("{}, block {}", fact.name, i + 1), ..fact };
            facts.extend(block.likelihood.facts().into_iter().map(numbered));
        }
        facts
    }
}

/// Some outputs of a linear forward map.
struct Outputs<'a> {
    linear: &'a dyn Linear,
    coefficients: Matrix,
}

impl<'a> Outputs<'a> {
    fn of(linear: &'a dyn Linear, outputs: Range<usize>) -> Self {
        let all = linear.coefficients();
        let pick = |i, j: usize| all[(i, outputs.start + j)];
        Self { linear, coefficients: Matrix::from_fn(all.rows(), outputs.len(), pick) }
    }
}

impl Linear for Outputs<'_> {
    fn coefficients(&self) -> &Matrix {
        &self.coefficients
    }

    fn basis(&self, points: &Matrix) -> Matrix {
        self.linear.basis(points)
    }

    fn basis_gradient(&self, point: &[f64]) -> Matrix {
        self.linear.basis_gradient(point)
    }
}

/// Compressed likelihoods of the blocks, with the indices of their hyperparameters.
struct CompressedBlocks {
    parts: Vec<(Box<dyn Compressed>, Vec<usize>)>,
    hyper: usize,
}

impl Compressed for CompressedBlocks {
    fn log_likelihood(&self, basis: &Matrix, hyper: &Matrix) -> Vec<f64> {
        let mut sums = vec![0.0; basis.rows()];
        for (compressed, places) in &self.parts {
            let own = Matrix::from_fn(hyper.rows(), places.len(), |i, j| hyper[(i, places[j])]);
            let values = compressed.log_likelihood(basis, &own);
            sums.iter_mut().zip(values).for_each(|(sum, value)| *sum += value);
        }
        sums
    }

    fn gradient(&self, basis: &[f64], hyper: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let mut by_basis = vec![0.0; basis.len()];
        let mut by_hyper = vec![0.0; self.hyper];
        for (compressed, places) in &self.parts {
            let own: Vec<f64> = places.iter().map(|&place| hyper[place]).collect();
            let (slopes, own) = compressed.gradient(basis, &own);
            by_basis.iter_mut().zip(slopes).for_each(|(sum, slope)| *sum += slope);
            scatter(places, &own, &mut by_hyper);
        }
        (by_basis, by_hyper)
    }
}

/// A block-diagonal matrix.
fn diagonal<'a>(blocks: impl Iterator<Item = &'a Matrix> + Clone) -> Matrix {
    let rows = blocks.clone().map(Matrix::rows).sum();
    let mut whole = Matrix::zeros(rows, blocks.clone().map(Matrix::columns).sum());
    let (mut first, mut left) = (0, 0);
    for block in blocks {
        for (i, row) in block.iter_rows().enumerate() {
            whole.row_mut(first + i)[left..left + row.len()].copy_from_slice(row);
        }
        first += block.rows();
        left += block.columns();
    }
    whole
}
