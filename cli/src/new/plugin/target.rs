//! `skeleton`: a normal density.

use std::collections::BTreeMap;

use lacuna::data::Parameter;
use lacuna::matrix::Matrix;
use lacuna::plugin::density::BoundDensity;
use lacuna::plugin::{Component, Context, Density};
use lacuna::run::Stop;
use lacuna::text::Complaints;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Independent normal densities of the parameters.
///
/// For testing samplers: with wide priors the posterior is known, its maximum lies at `mean`, and the log evidence is
/// the sum of the logarithms of `sd` times the prior's density and the square root of 2 pi. For any other density use
/// `expression`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Skeleton {
    /// Mean of each parameter, by name and in its unit; zero by default.
    pub mean: BTreeMap<String, f64>,
    /// Standard deviation of each parameter, by name and in its unit; one by default.
    pub sd: BTreeMap<String, f64>,
}

impl Component for Skeleton {
    fn check(&self, context: &Context<'_>, complaints: &mut Complaints<'_>) {
        for (table, values) in [("mean", &self.mean), ("sd", &self.sd)] {
            for name in values.keys() {
                if !context.parameters.iter().any(|parameter| parameter.name == *name) {
                    let place = format!("{table}.{name}");
                    complaints.at(&place).say(format!("there is no parameter `{name}`"));
                }
            }
        }
        for (name, sd) in self.sd.iter().filter(|(_, sd)| !(**sd > 0.0 && sd.is_finite())) {
            complaints
                .at(&format!("sd.{name}"))
                .say("no standard deviation")
                .expected("a number above 0")
                .found(sd);
        }
    }
}

impl Density for Skeleton {
    fn bind(&self, parameters: &[Parameter]) -> Result<Box<dyn BoundDensity>, Stop> {
        let law = |parameter: &Parameter| {
            let of = |table: &BTreeMap<String, f64>| table.get(&parameter.name).copied();
            (of(&self.mean).unwrap_or(0.0), of(&self.sd).unwrap_or(1.0))
        };
        Ok(Box::new(Laws(parameters.iter().map(law).collect())))
    }
}

/// Mean and standard deviation of each parameter, in the order of the study.
struct Laws(Vec<(f64, f64)>);

impl BoundDensity for Laws {
    fn log_density(&self, points: &Matrix) -> Vec<f64> {
        points.iter_rows().map(|point| self.gradient(point).0).collect()
    }

    fn gradient(&self, point: &[f64]) -> (f64, Vec<f64>) {
        let scaled: Vec<f64> =
            point.iter().zip(&self.0).map(|(x, (mean, sd))| (x - mean) / sd).collect();
        let value = -0.5 * scaled.iter().map(|z| z * z).sum::<f64>();
        // At infinite or NaN coordinates the density is zero.
        if !value.is_finite() {
            return (f64::NEG_INFINITY, vec![0.0; point.len()]);
        }
        (value, scaled.iter().zip(&self.0).map(|(z, (_, sd))| -z / sd).collect())
    }
}

lacuna::register!(Density, "skeleton", Skeleton);

#[cfg(test)]
mod tests {
    use super::*;
    use lacuna::math::distribution::Distribution;

    fn parameters() -> [Parameter; 2] {
        ["a", "b"].map(|name| Parameter::plain(name, Distribution::Normal([0.0, 3.0])))
    }

    #[test]
    fn it_keeps_the_contract() {
        let judged = lacuna_contract::density("skeleton", &Skeleton::default(), &parameters());
        assert_eq!(judged, Ok(()));
    }

    #[test]
    fn it_falls_by_half_at_one_standard_deviation() {
        let table = |value: f64| BTreeMap::from([("b".to_owned(), value)]);
        let bound = Skeleton { mean: table(5.0), sd: table(2.0) }.bind(&parameters()).unwrap();
        let points = Matrix::from_rows(2, [[0.0, 5.0], [1.0, 5.0], [0.0, 3.0], [1.0, 9.0]]);
        assert_eq!(bound.log_density(&points), [0.0, -0.5, -0.5, -2.5]);
        assert_eq!(bound.gradient(&[1.0, 9.0]), (-2.5, vec![-1.0, -1.0]));
    }
}
