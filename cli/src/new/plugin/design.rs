//! `skeleton`: a Kronecker sequence.

use lacuna::math::random::{Stream, uniform};
use lacuna::matrix::Matrix;
use lacuna::plugin::{Component, Context, Design};
use lacuna::run::Stop;
use lacuna::text::Complaints;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Kronecker sequence of the generalised golden ratio: every point is a fixed step from the previous one, modulo the
/// unit cube.
///
/// The points fill the space evenly for any number of runs, and a longer design begins with the shorter one. For more
/// than a few parameters the steps become similar and `sobol` or `latin_hypercube` is better.
///
/// Reference: Roberts, "The unreasonable effectiveness of quasirandom sequences" (2018).
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Skeleton {
    /// Set to true to start the sequence at a random point of the cube instead of its centre.
    pub random_start: bool,
}

impl Default for Skeleton {
    fn default() -> Self {
        Self { random_start: true }
    }
}

/// Number of parameters above which neighbouring steps differ by less than 5 %.
const MOST_PARAMETERS: usize = 12;

impl Component for Skeleton {
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        let found = context.parameters.len();
        if found > MOST_PARAMETERS {
            complaints
                .at("use")
                .say("too many parameters for a Kronecker sequence")
                .expected(format!("at most {MOST_PARAMETERS}"))
                .found(found)
                .help("use `sobol` or `latin_hypercube`");
        }
    }
}

impl Design for Skeleton {
    fn points(&self, count: usize, dimension: usize, stream: &Stream) -> Result<Matrix, Stop> {
        let mut rng = stream.generator();
        let start = |_| if self.random_start { uniform(&mut rng) } else { 0.5 };
        let start: Vec<f64> = (0..dimension).map(start).collect();
        let steps = steps(dimension);
        Ok(Matrix::from_fn(count, dimension, |i, j| {
            let place = (start[j] + (i + 1) as f64 * steps[j]).fract();
            // The unit cube is open: zero is excluded.
            place.max(f64::EPSILON)
        }))
    }
}

/// The steps `1/g, 1/g², …`, where `g` is the root above one of `g^(d + 1) = g + 1`: the golden ratio for `d = 1`.
fn steps(dimension: usize) -> Vec<f64> {
    let mut g = 2.0_f64;
    // The iteration reduces the error at least by a factor of three.
    for _ in 0..60 {
        g = (1.0 + g).powf(1.0 / (dimension as f64 + 1.0));
    }
    (1..=dimension).map(|k| g.powi(-(k as i32))).collect()
}

lacuna::register!(Design, "skeleton", Skeleton);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_keeps_the_contract() {
        assert_eq!(lacuna_contract::design("skeleton", &Skeleton::default()), Ok(()));
    }

    /// Sources: the golden ratio is `(1 + sqrt(5)) / 2`; the plastic number is OEIS A060006.
    #[test]
    fn its_steps_are_powers_of_the_golden_ratio_and_of_the_plastic_number() {
        let golden = 0.5 * (1.0 + 5.0_f64.sqrt());
        assert!((steps(1)[0] - 1.0 / golden).abs() < 1e-15);
        let plastic = 1.324_717_957_244_746_f64;
        for (k, step) in steps(2).iter().enumerate() {
            assert!((step - plastic.powi(-1 - k as i32)).abs() < 1e-15, "{step}");
        }
    }

    /// The three-distance theorem (Sós 1958): the gaps between neighbours have at most three lengths.
    #[test]
    fn in_one_dimension_there_are_at_most_three_gaps() {
        let points = Skeleton::default().points(50, 1, &Stream::root(1)).unwrap();
        let mut places = points.into_vec();
        places.sort_by(f64::total_cmp);
        let mut gaps: Vec<f64> = places.windows(2).map(|pair| pair[1] - pair[0]).collect();
        gaps.sort_by(f64::total_cmp);
        gaps.dedup_by(|a, b| (*a - *b).abs() < 1e-12);
        assert!(gaps.len() <= 3, "{gaps:?}");
    }
}
