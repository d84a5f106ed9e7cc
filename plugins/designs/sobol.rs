//! `sobol`: a low-discrepancy sequence.

use lacuna::data::Parameter;
use lacuna::math::random::{Stream, uniform};
use lacuna::math::sobol::{self, LARGEST_DIMENSION};
use lacuna::plugin::{Component, Context, Design};
use lacuna::run::Stop;
use lacuna::text::problem::Complaints;
use lacuna_linalg::Matrix;
use rand::Rng;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Sobol' sequence with the direction numbers of Joe and Kuo, for up to 128 parameters.
///
/// The points fill the space evenly, best if their number is a power of two, and a longer design begins with the
/// shorter one. Scrambling keeps the evenness and makes averages unbiased.
///
/// References: Joe and Kuo, SIAM J. Sci. Comput. 30 (2008) 2635; Owen, J. Complexity 14 (1998) 466; the hash-based
/// nested scrambling is that of Laine and Karras, Computer Graphics Forum 30 (2011) 1227.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Sobol {
    /// Scrambling of the binary digits.
    pub scramble: Scramble,
}

/// Scrambling of the binary digits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Scramble {
    /// Nested uniform scrambling (Owen): random points that are as even as the sequence itself, with unbiased
    /// averages.
    Owen,
    /// No randomisation: the sequence without its first point, which is the corner of the cube.
    None,
}

impl Default for Sobol {
    fn default() -> Self {
        Self { scramble: Scramble::Owen }
    }
}

impl Component for Sobol {
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        let (found, most) = (context.parameters.len(), LARGEST_DIMENSION);
        if found > most {
            complaints
                .at("use")
                .say("too many parameters for a Sobol' sequence")
                .expected(format!("at most {most}"))
                .found(found)
                .help("use `latin_hypercube` or `random`");
        }
    }
}

impl Design for Sobol {
    fn points(&self, count: usize, dimension: usize, stream: &Stream) -> Result<Matrix, Stop> {
        if dimension > LARGEST_DIMENSION {
            return Err(Stop::new(format!(
                "Sobol' sequences have at most {LARGEST_DIMENSION} dimensions, not {dimension}"
            )));
        }
        let skipped = u32::from(self.scramble == Scramble::None);
        if u32::try_from(count).is_err() {
            return Err(Stop::new(format!("a Sobol' sequence has fewer than {count} points")));
        }
        let mut points = Matrix::zeros(count, dimension);
        for j in 0..dimension {
            let directions = sobol::directions(j);
            let mut rng = stream.named("axis").at(j as u64).generator();
            let key = rng.next_u32();
            for i in 0..count {
                let digits = sobol::digits(&directions, i as u32 + skipped);
                let place = match self.scramble {
                    Scramble::None => f64::from(digits),
                    Scramble::Owen => f64::from(sobol::scrambled(digits, key)) + uniform(&mut rng),
                };
                points[(i, j)] = place / 4_294_967_296.0;
            }
        }
        Ok(points)
    }

    fn extend(
        &self,
        _: &[Parameter],
        known: &Matrix,
        count: usize,
        stream: &Stream,
    ) -> Result<Matrix, Stop> {
        super::next_of_sequence(self, known, count, stream)
    }
}

lacuna::register!(Design, "sobol", Sobol, aliases: ["sobol_sequence", "qmc", "saltelli"]);

#[cfg(test)]
mod tests {
    use super::*;

    fn design(scramble: Scramble, count: usize, dimension: usize) -> Matrix {
        Sobol { scramble }.points(count, dimension, &Stream::root(3)).unwrap()
    }

    /// Source: scipy 1.17.1, `qmc.Sobol(d, scramble=False).random(n)`, whose first point is the origin.
    #[test]
    fn plain_points_are_those_of_scipy() {
        let points = design(Scramble::None, 4, 5);
        let expected = [
            [0.5, 0.5, 0.5, 0.5, 0.5],
            [0.75, 0.25, 0.25, 0.25, 0.75],
            [0.25, 0.75, 0.75, 0.75, 0.25],
            [0.375, 0.375, 0.625, 0.875, 0.375],
        ];
        for (row, expected) in points.iter_rows().zip(expected) {
            assert_eq!(row, expected);
        }
        let far = design(Scramble::None, 1001, 128);
        let columns = [0, 1, 2, 50, 100, 127].map(|j| far[(999, j)]);
        assert_eq!(columns, FAR);
    }

    /// Reference values of point 1000 in dimensions 1, 2, 3, 51, 101 and 128.
    #[expect(clippy::unreadable_literal, reason = "digits as scipy prints them")]
    const FAR: [f64; 6] =
        [0.2197265625, 0.0966796875, 0.5185546875, 0.3525390625, 0.7685546875, 0.5439453125];

    /// Scrambling preserves the net property: of 2^m points, a one-dimensional projection has one in each of 2^m
    /// equal slices.
    #[test]
    fn scrambling_keeps_one_point_in_every_slice() {
        let points = design(Scramble::Owen, 256, 6);
        for j in 0..6 {
            let mut slices: Vec<usize> =
                points.column(j).iter().map(|x| (x * 256.0) as usize).collect();
            slices.sort_unstable();
            assert_eq!(slices, (0..256).collect::<Vec<_>>());
        }
    }

    #[test]
    fn a_longer_design_begins_with_the_shorter_one() {
        let (short, long) = (design(Scramble::Owen, 10, 3), design(Scramble::Owen, 20, 3));
        for i in 0..10 {
            assert_eq!(short.row(i), long.row(i));
        }
    }
}
