//! Random streams that do not depend on the order or the thread in which they are used.
//!
//! A [`Stream`] is identified by the study's seed and a path of labels and indices (stage, chain, step, replicate). Two
//! different paths give independent `ChaCha8` generators; the same path always gives the same numbers. `ChaCha` is a
//! counter-based generator, so a stream costs nothing until it is read.

use rand::rngs::ChaCha8Rng;
use rand::{Rng, RngExt, SeedableRng};

/// A node in the tree of random streams of one study.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Stream {
    key: [u64; 4],
}

impl Stream {
    /// The root stream of a study with this seed.
    pub fn root(seed: u64) -> Self {
        Self { key: [seed, 0x6c61_6375_6e61_0001, 0x9e37_79b9_7f4a_7c15, 0xd1b5_4a32_d192_ed03] }
    }

    /// The stream with the key that [`Stream::key`] returned.
    pub fn from_key(key: [u64; 4]) -> Self {
        Self { key }
    }

    /// Key of the stream: the same key gives the same sequence of numbers.
    pub fn key(&self) -> [u64; 4] {
        self.key
    }

    /// The sub-stream with a label, such as a stage.
    pub fn named(&self, label: &str) -> Self {
        // FNV-1a over the label, then mixed into the key; the labels are few and fixed in the source, so collisions can
        // be excluded.
        let hash = label.bytes().fold(0xcbf2_9ce4_8422_2325_u64, |h, b| {
            (h ^ u64::from(b)).wrapping_mul(0x0000_0100_0000_01b3)
        });
        self.mixed(hash, 0x5851_f42d_4c95_7f2d)
    }

    /// The sub-stream with an index, such as a chain, a step or a replicate.
    pub fn at(&self, index: u64) -> Self {
        self.mixed(index, 0x1405_7b7e_f767_814f)
    }

    fn mixed(&self, value: u64, salt: u64) -> Self {
        let mut key = self.key;
        let mut carry = value ^ salt;
        for round in 0..2 {
            for word in &mut key {
                carry = split_mix(carry ^ *word).wrapping_add(round);
                *word = carry;
            }
        }
        Self { key }
    }

    /// The generator of this stream, at its beginning.
    pub fn generator(&self) -> ChaCha8Rng {
        let mut seed = [0_u8; 32];
        for (chunk, word) in seed.chunks_exact_mut(8).zip(self.key) {
            chunk.copy_from_slice(&word.to_le_bytes());
        }
        ChaCha8Rng::from_seed(seed)
    }
}

/// Finaliser of `SplitMix64` (Steele, Lea, Flood, OOPSLA 2014), a bijection of 64-bit words.
fn split_mix(mut z: u64) -> u64 {
    z = z.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// A uniform number in the open interval (0, 1).
pub fn uniform(rng: &mut impl Rng) -> f64 {
    loop {
        let u: f64 = rng.random();
        // Zero is excluded, because quantile functions and logarithms are applied to the number.
        if u > 0.0 {
            return u;
        }
    }
}

/// A standard normal number, by the polar method of Marsaglia and Bray (1964).
pub fn normal(rng: &mut impl Rng) -> f64 {
    loop {
        let (u, v) = (2.0 * uniform(rng) - 1.0, 2.0 * uniform(rng) - 1.0);
        let s = u * u + v * v;
        if s > 0.0 && s < 1.0 {
            return u * (-2.0 * s.ln() / s).sqrt();
        }
    }
}

/// A uniformly distributed whole number below `bound`.
pub fn below(rng: &mut impl Rng, bound: usize) -> usize {
    rng.random_range(0..bound)
}

/// A random permutation of `0..count` (Fisher and Yates).
pub fn permutation(rng: &mut impl Rng, count: usize) -> Vec<usize> {
    let mut order: Vec<usize> = (0..count).collect();
    for i in (1..count).rev() {
        order.swap(i, below(rng, i + 1));
    }
    order
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_path_gives_the_same_numbers_and_another_path_others() {
        let root = Stream::root(7);
        let draw = |s: &Stream| s.generator().next_u64();
        assert_eq!(draw(&root.named("design").at(3)), draw(&root.named("design").at(3)));
        assert_ne!(draw(&root.named("design").at(3)), draw(&root.named("design").at(4)));
        assert_ne!(draw(&root.named("design").at(3)), draw(&root.at(3).named("design")));
        assert_ne!(draw(&root.named("design")), draw(&Stream::root(8).named("design")));
    }

    #[test]
    fn neighbouring_streams_are_uncorrelated() {
        // Source: the correlation of two independent samples of size n has sd 1/sqrt(n).
        let n = 20_000;
        let (mut a, mut b) = (Stream::root(1).at(0).generator(), Stream::root(1).at(1).generator());
        let sum: f64 = (0..n).map(|_| normal(&mut a) * normal(&mut b)).sum();
        assert!((sum / f64::from(n)).abs() < 4.0 / f64::from(n).sqrt());
    }

    #[test]
    fn normal_numbers_have_the_moments_of_the_normal_law() {
        let n = 40_000;
        let mut rng = Stream::root(2).generator();
        let z: Vec<f64> = (0..n).map(|_| normal(&mut rng)).collect();
        let moment = |k: i32| z.iter().map(|x| x.powi(k)).sum::<f64>() / f64::from(n);
        // Variances of the sample moments: 1, 2, 15, 96, each over n.
        for (k, expected, variance) in
            [(1, 0.0, 1.0), (2, 1.0, 2.0), (3, 0.0, 15.0), (4, 3.0, 96.0)]
        {
            let bound = 4.0 * (variance / f64::from(n)).sqrt();
            assert!((moment(k) - expected).abs() < bound, "moment {k}: {}", moment(k));
        }
    }
}
