//! Detection of walkers that never reached the bulk of the density.

use serde::{Deserialize, Serialize};

use crate::data::Draws;
use crate::math::moments::{quantile, sorted};

/// Number of blocks of steps that are examined separately.
const BLOCKS: usize = 4;

/// Chains whose log density stays far below that of the others.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Stranded {
    /// Chains still outside the bulk in the last block; drop them, or better, start them elsewhere.
    pub to_the_end: Vec<usize>,
    /// Chains that reached the bulk late; a longer burn-in removes their transient.
    pub late: Vec<usize>,
}

impl Stranded {
    /// Finds the stranded chains among draws from which the burn-in has been dropped.
    ///
    /// The steps are cut into four blocks. The bulk is the region of the best chain, the one with the largest median
    /// log density `m`. A chain is outside in a block if even its *largest* log density there is more than
    /// `10 + 4 sqrt(d / 2)` below `m`, for `d` coordinates: the log density of a normal law has standard deviation
    /// `sqrt(d / 2)`, and a chain that visits the bulk at all comes near its median. Heavy tails do not matter, because
    /// a chain returns from them. A chain that is outside in the last block counts as stranded to the end; one that is
    /// outside only in an earlier block counts as late.
    ///
    /// The rule cannot distinguish a stranded chain from one in a second mode that is wide and low, nor the best chain
    /// from one in a narrow spike of negligible mass; that would need the evidence of both modes.
    pub fn among(draws: &Draws) -> Self {
        // Four standard deviations of the log density of a normal law, plus a margin of ten for other shapes.
        let threshold = Self::bulk(draws) - 10.0 - 4.0 * (0.5 * draws.dimension() as f64).sqrt();
        let mut found = Self::default();
        for chain in 0..draws.chains {
            let series = draws.log_density_of(chain);
            let outside = |block: usize| {
                let from = block * series.len() / BLOCKS;
                let to = (block + 1) * series.len() / BLOCKS;
                let highest = series[from..to].iter().copied().fold(f64::NEG_INFINITY, f64::max);
                to > from && highest < threshold
            };
            if outside(BLOCKS - 1) {
                found.to_the_end.push(chain);
            } else if (0..BLOCKS - 1).any(outside) {
                found.late.push(chain);
            }
        }
        found
    }

    /// Largest median of the log density along a chain.
    fn bulk(draws: &Draws) -> f64 {
        let median = |chain| quantile(&sorted(draws.log_density_of(chain)), 0.5);
        (0..draws.chains).map(median).fold(f64::NEG_INFINITY, f64::max)
    }
}

/// Acceptance rate of each chain: the fraction of steps at which it moved.
pub fn acceptance(draws: &Draws) -> Vec<f64> {
    let moved = |chain: usize| {
        (1..draws.steps).filter(|&t| draws.point(chain, t) != draws.point(chain, t - 1)).count()
    };
    let steps = draws.steps.saturating_sub(1).max(1) as f64;
    (0..draws.chains).map(|chain| moved(chain) as f64 / steps).collect()
}
