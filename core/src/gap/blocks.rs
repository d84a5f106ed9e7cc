//! Blocks of a curve that stand in for replicates where there are none to set aside.

use std::ops::Range;

use crate::math::random::{Stream, below};

/// The most blocks into which a curve is cut.
const MOST: usize = 24;

/// The fewest values of a block.
const SHORTEST: usize = 4;

/// The fewest blocks of which one is set aside: two, and one that keeps it from the next.
const GROUP: usize = 3;

/// The fewest blocks that are set aside.
const FEWEST: usize = 2;

/// The places among so many values of the blocks that are set aside: of as many blocks next to each other as the share
/// says one, by lot, that has neighbours of its own group on both sides. So no two touch, none is at an end of the curve, and
/// a cycle has them at all its phases. None where the curve is too short.
pub fn set_aside(values: usize, share: f64, stream: &Stream) -> Vec<Range<usize>> {
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
                let blocks = set_aside(values, share, &Stream::root(seed));
                assert_eq!(blocks.len(), count);
                assert!(blocks[0].start >= SHORTEST && blocks[count - 1].end < values);
                assert!(blocks.windows(2).all(|w| w[1].start >= w[0].end + 2 * SHORTEST));
                let all: usize = blocks.iter().map(Range::len).sum();
                assert!((all as f64 / values as f64 - share).abs() < 0.06, "{values} {all}");
            }
        }
        assert!(set_aside(31, 0.25, &Stream::root(1)).is_empty());
        assert!(set_aside(500, 0.0, &Stream::root(1)).is_empty());
    }
}
