//! Sobol' sequences with the direction numbers of Joe and Kuo (SIAM J. Sci. Comput. 30 (2008) 2635).

mod joe_kuo;

use joe_kuo::DIRECTIONS;

/// Largest dimension for which direction numbers are known.
pub const LARGEST_DIMENSION: usize = DIRECTIONS.len() + 1;

/// A point of the unscrambled sequence in the unit cube; the sequence is shifted by one, because its first point is the
/// corner of the cube.
///
/// # Panics
/// Above [`LARGEST_DIMENSION`] dimensions.
pub fn point(index: u32, dimension: usize) -> Vec<f64> {
    (0..dimension).map(|j| f64::from(digits(&directions(j), index + 1)) / 4_294_967_296.0).collect()
}

/// Direction numbers of a dimension as 32-bit binary fractions, by the recurrence of Joe and Kuo.
pub fn directions(dimension: usize) -> [u32; 32] {
    let mut v = [0_u32; 32];
    if dimension == 0 {
        for (i, v) in v.iter_mut().enumerate() {
            *v = 1 << (31 - i);
        }
        return v;
    }
    let (inner, first) = DIRECTIONS[dimension - 1];
    let degree = first.len();
    for i in 0..32 {
        v[i] = if i < degree {
            first[i] << (31 - i)
        } else {
            let mut value = v[i - degree] ^ (v[i - degree] >> degree);
            for k in 1..degree {
                if (inner >> (degree - 1 - k)) & 1 == 1 {
                    value ^= v[i - k];
                }
            }
            value
        };
    }
    v
}

/// Point `index` of the sequence in Gray code order (Antonov and Saleev 1979).
pub fn digits(directions: &[u32; 32], index: u32) -> u32 {
    let gray = index ^ (index >> 1);
    (0..32).filter(|bit| (gray >> bit) & 1 == 1).fold(0, |x, bit| x ^ directions[bit as usize])
}

/// Owen's nested scrambling, by a hash in which each bit depends on higher bits only.
pub fn scrambled(digits: u32, key: u32) -> u32 {
    let mut x = digits.reverse_bits().wrapping_add(key);
    x ^= x.wrapping_mul(0x6c50_b47c);
    x ^= x.wrapping_mul(0xb82f_1e52);
    x ^= x.wrapping_mul(0xc7af_e638);
    x ^= x.wrapping_mul(0x8d22_f6e6);
    x.reverse_bits()
}
