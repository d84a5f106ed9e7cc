//! Blocks of a curve that are held out if there are no replicates.

use std::ops::Range;

use lacuna::math::random::{Stream, below};

/// Largest number of blocks into which a curve is divided.
const MOST: usize = 24;

/// Smallest number of values in a block.
const SHORTEST: usize = 4;

/// Smallest number of blocks in a group of which one is held out: two neighbours keep held-out blocks apart.
const GROUP: usize = 3;

/// The smallest number of held-out blocks.
const FEWEST: usize = 2;

/// The held-out blocks among `values` values, as ranges of indices: one block of each group of `1 / share` neighbouring
/// blocks, drawn at random from those with neighbours of the same group on both sides. No two held-out blocks touch,
/// none is at an end of the curve, and they fall at all phases of a periodic signal. Empty if the curve is too short.
pub fn held_out_blocks(values: usize, share: f64, stream: &Stream) -> Vec<Range<usize>> {
    if share <= 0.0 {
        return Vec::new();
    }
    let group = ((1.0 / share).round() as usize).max(GROUP);
    let groups = MOST.min(values / SHORTEST) / group;
    if groups < FEWEST {
        return Vec::new();
    }
    let blocks = groups * group;
    let edge = |block: usize| block * values / blocks;
    let mut rng = stream.generator();
    let block = |g: usize, inner: usize| edge(g * group + inner)..edge(g * group + inner + 1);
    (0..groups).map(|g| block(g, 1 + below(&mut rng, group - 2))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_are_apart_and_inside() {
        for seed in 0..20 {
            for (values, share, count) in
                [(600, 0.25, 6), (96, 0.25, 6), (80, 0.25, 5), (32, 0.25, 2), (100, 0.3, 8)]
            {
                let blocks = held_out_blocks(values, share, &Stream::root(seed));
                assert_eq!(blocks.len(), count);
                assert!(blocks[0].start >= SHORTEST && blocks[count - 1].end < values);
                assert!(blocks.windows(2).all(|w| w[1].start >= w[0].end + 2 * SHORTEST));
                let all: usize = blocks.iter().map(Range::len).sum();
                assert!((all as f64 / values as f64 - share).abs() < 0.06, "{values} {all}");
            }
        }
        assert!(held_out_blocks(31, 0.25, &Stream::root(1)).is_empty());
        assert!(held_out_blocks(500, 0.0, &Stream::root(1)).is_empty());
    }
}
