//! `skeleton`: the crest factor of a curve.

use lacuna::data::Unit;
use lacuna::plugin::quantity::{Arguments, Functional, Misfit, functional};
use lacuna::plugin::{Component, Quantity};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Crest factor: the largest magnitude of a curve divided by its root mean square, or by that about its mean.
///
/// It is √2 for a sine and larger for impacts. It is undefined for a curve of zeros.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Skeleton {
    /// `true` takes the mean of the values off first.
    pub about_mean: bool,
}

impl Component for Skeleton {}

impl Quantity for Skeleton {
    fn bind(&self, arguments: &Arguments<'_>) -> Result<Box<dyn Functional>, Vec<Misfit>> {
        let curve = arguments.curve()?;
        if curve.grid.len() < 2 {
            let misfit = Misfit::new("use", "a curve of one point has no crest factor");
            return Err(vec![misfit.help("widen the `window`")]);
        }
        let about_mean = self.about_mean;
        Ok(functional(Unit::dimensionless(), move |values| {
            let count = values.len() as f64;
            let mean = if about_mean { values.iter().sum::<f64>() / count } else { 0.0 };
            let square = values.iter().map(|y| (y - mean).powi(2)).sum::<f64>() / count;
            let peak = values.iter().map(|y| (y - mean).abs()).fold(0.0, f64::max);
            peak / square.sqrt()
        }))
    }
}

lacuna::register!(Quantity, "skeleton", Skeleton);

#[cfg(test)]
mod tests {
    use super::*;
    use lacuna::plugin::quantity::Curve;

    #[test]
    fn it_keeps_the_contract() {
        assert_eq!(lacuna_contract::quantity("skeleton", &Skeleton::default()), Ok(()));
    }

    #[test]
    fn a_square_wave_has_a_crest_factor_of_one() {
        let (unit, seconds) = (Unit::dimensionless(), Unit::parse("s").unwrap());
        let grid = [0.0, 1.0, 2.0, 3.0];
        let curve = Curve { name: "y", unit: &unit, axis: "t", grid: &grid, grid_unit: &seconds };
        let factor = |options: Skeleton, values: &[f64]| {
            options.bind(&Arguments::Curve(curve)).unwrap().value(values)
        };
        assert_eq!(factor(Skeleton::default(), &[-2.0, 2.0, -2.0, 2.0]), 1.0);
        assert_eq!(factor(Skeleton { about_mean: true }, &[5.0, 9.0, 5.0, 9.0]), 1.0);
    }
}
