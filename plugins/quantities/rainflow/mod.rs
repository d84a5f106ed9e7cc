//! `rainflow`: cycles of a record, and the fatigue damage that they do.

mod count;
mod life;
#[cfg(test)]
mod tests;

use lacuna::data::Unit;
use lacuna::plugin::quantity::{Arguments, Curve, Functional, Misfit, functional, in_unit};
use lacuna::plugin::{Component, Quantity};
use lacuna::text::quantity;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use self::count::{Cycle, cycles};
pub use self::life::{Law, Material, Mean};

/// Rainflow counting: the fatigue damage of a record, its largest range, or its number of cycles.
///
/// Cycles are counted as in ASTM E1049-85, section 5.4.4: closed cycles as one, the rest of the record as half cycles. Damage
/// adds up by the rule of Palmgren and Miner, `D = Σ n / N`; a record with `D = 0.001` can be repeated a thousand times.
///
/// ```text
/// stress_life   σa = σf' (2N)^b                              Basquin
/// strain_life   εa = σf'/E (2N)^b + εf' (2N)^c               Coffin, Manson and Basquin, solved for N
///
/// morrow                 σf' - σm in place of σf' in the elastic term
/// goodman                σa / (1 - σm/σu) in place of σa                          stress_life only
/// smith_watson_topper    √(σmax σa) in place of σa;  σmax εa = σf'²/E (2N)^2b + σf' εf' (2N)^(b+c)
/// ```
///
/// `2N` is the number of reversals, `σm` the mean stress of a cycle, `σmax` its largest stress. A compressive mean stress
/// prolongs the life as the formulas say. Stress and strain are converted by the modulus, `σ = E ε`: at a notch that yields,
/// the record must be the local strain and its elastic mean stress is an upper bound. A cycle whose mean stress reaches
/// `σf'` (Morrow) or `σu` (Goodman) has no life: its damage is undefined, and the draw is counted as such.
///
/// For a curve `N = C Δσ^-m` of a design code: `b = -1/m`, `σf' = (2C)^(1/m) / 2`.
///
/// The noise of a measuring chain makes cycles of its own: with a Basquin exponent of -0.1 they do little damage, but they
/// dominate the number of cycles. Damage of the true response leaves the scatter between replicates out, as `include` does
/// by default.
///
/// ```toml
/// [[quantity]]
/// name = "damage"
/// use = "rainflow"
/// law = "strain_life"
/// modulus = { value = 193, unit = "GPa" }
/// fatigue_strength_coefficient = { value = 1000, unit = "MPa" }
/// fatigue_strength_exponent = -0.114
/// fatigue_ductility_coefficient = 0.171
/// fatigue_ductility_exponent = -0.402
/// mean_stress = "morrow"
/// ```
///
/// References: ASTM E1049-85 (2017); Dowling, Mechanical Behavior of Materials, 4th edition (2013), chapters 9 and 14.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Rainflow {
    /// Number that is reported.
    pub output: Output,
    /// Law of the life: number of cycles to failure as a function of the amplitude. Only for `output = "damage"`, like all
    /// constants of the material.
    pub law: LifeLaw,
    /// Young's modulus `E`, with a unit as in `{ value = 193, unit = "GPa" }`. Needed for strain, and for `strain_life`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub modulus: Option<quantity::Quantity>,
    /// Fatigue strength coefficient `σf'`, with a unit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fatigue_strength_coefficient: Option<quantity::Quantity>,
    /// Fatigue strength exponent `b` (Basquin), below zero.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fatigue_strength_exponent: Option<f64>,
    /// Fatigue ductility coefficient `εf'`, a strain.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fatigue_ductility_coefficient: Option<f64>,
    /// Fatigue ductility exponent `c` (Coffin and Manson), below zero.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fatigue_ductility_exponent: Option<f64>,
    /// Correction for the mean stress of a cycle.
    pub mean_stress: MeanStress,
    /// Ultimate tensile strength `σu`, with a unit, for Goodman's correction.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ultimate_strength: Option<quantity::Quantity>,
    /// Smallest range of a cycle that is counted, in the unit of the response or with a unit of its own. Default: all.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub least_range: Option<quantity::Quantity>,
}

/// Number that is reported of the cycles.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Output {
    /// Damage of one record: the share of the life that it uses up.
    #[default]
    Damage,
    /// Range of the largest cycle, in the unit of the response; 0 without cycles.
    Range,
    /// Number of cycles; a half cycle counts 0.5.
    Cycles,
}

/// Law of the life.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum LifeLaw {
    /// Stress amplitude and Basquin's law, for long lives.
    #[default]
    StressLife,
    /// Strain amplitude and the law of Coffin, Manson and Basquin, for lives with plastic strain too.
    StrainLife,
}

/// Correction for the mean stress of a cycle.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum MeanStress {
    /// No correction: the amplitude alone determines the life.
    #[default]
    None,
    /// Goodman's line between amplitude and ultimate strength.
    Goodman,
    /// Morrow's correction of the elastic term.
    Morrow,
    /// Smith, Watson and Topper's parameter of amplitude and largest stress.
    SmithWatsonTopper,
}

impl Component for Rainflow {}

impl Quantity for Rainflow {
    fn bind(&self, arguments: &Arguments<'_>) -> Result<Box<dyn Functional>, Vec<Misfit>> {
        let curve = arguments.curve()?;
        let least = self.least_range.as_ref();
        let unit = curve.unit.difference();
        let least = least.map_or(Ok(0.0), |least| in_unit("least_range", least, &unit))?;
        let counted = move |values: &[f64]| -> Option<Vec<Cycle>> {
            let found = cycles(values)?.into_iter();
            Some(found.filter(|cycle| cycle.range >= least).collect())
        };
        let sum = |all: Option<Vec<Cycle>>, of: &dyn Fn(&Cycle) -> f64| {
            all.map_or(f64::NAN, |all| all.iter().map(of).sum())
        };
        Ok(match self.output {
            Output::Cycles => functional(Unit::dimensionless(), move |values| {
                sum(counted(values), &|cycle| cycle.count)
            }),
            Output::Range => functional(unit, move |values| {
                let most = |all: Vec<Cycle>| all.iter().fold(0.0_f64, |m, c| m.max(c.range));
                counted(values).map_or(f64::NAN, most)
            }),
            Output::Damage => {
                let (material, factor) = self.material(&curve)?;
                functional(Unit::dimensionless(), move |values| {
                    let damage = |cycle: &Cycle| {
                        let (amplitude, mean) = (0.5 * cycle.range * factor, cycle.mean * factor);
                        cycle.count * material.damage(amplitude, mean)
                    };
                    sum(counted(values), &damage)
                })
            }
        })
    }
}

impl Rainflow {
    /// The material, and the factor that converts a value of the curve to the argument of its law: stress in Pa, or strain.
    fn material(&self, curve: &Curve<'_>) -> Result<(Material, f64), Vec<Misfit>> {
        let mut missing = Vec::new();
        let pascal = Unit::parse("Pa").unwrap_or_default();
        let mut stress = |key: &str, value: Option<&quantity::Quantity>, why: &str| {
            let found = match value {
                None => Err(vec![missing_key(key, why)]),
                Some(value) if value.unit.is_none() => {
                    let misfit = Misfit::new(key, format!("`{key}` needs a unit"));
                    let expected =
                        "a stress with its unit, such as `{ value = 193, unit = \"GPa\" }`";
                    Err(vec![misfit.expected(expected).found(value.value)])
                }
                Some(value) => in_unit(key, value, &pascal).and_then(|x| positive(key, x)),
            };
            found.map_err(|misfits| missing.extend(misfits)).unwrap_or(f64::NAN)
        };
        let (to_stress, to_strain) =
            (curve.unit.factor_to(&pascal), curve.unit.factor_to(&Unit::dimensionless()));
        let is_strain_law = self.law == LifeLaw::StrainLife;
        let why =
            format!("`law = \"{}\"`", if is_strain_law { "strain_life" } else { "stress_life" });
        let strength = stress(
            "fatigue_strength_coefficient",
            self.fatigue_strength_coefficient.as_ref(),
            &why,
        );
        let modulus = if is_strain_law || to_strain.is_some() {
            stress("modulus", self.modulus.as_ref(), "the conversion of strain and stress")
        } else {
            1.0
        };
        let mean = match self.mean_stress {
            MeanStress::None => Mean::None,
            MeanStress::Morrow => Mean::Morrow,
            MeanStress::SmithWatsonTopper => Mean::SmithWatsonTopper,
            MeanStress::Goodman => {
                let key = "ultimate_strength";
                Mean::Goodman(stress(key, self.ultimate_strength.as_ref(), "Goodman's correction"))
            }
        };
        let mut number = |key: &str, value: Option<f64>, check: fn(&str, f64) -> _| {
            let found = value.ok_or_else(|| vec![missing_key(key, &why)]);
            let found: Result<f64, Vec<Misfit>> = found.and_then(|x| check(key, x));
            found.map_err(|misfits| missing.extend(misfits)).unwrap_or(f64::NAN)
        };
        let exponent =
            number("fatigue_strength_exponent", self.fatigue_strength_exponent, negative);
        let law = if is_strain_law {
            Law::Strain {
                modulus,
                ductility: number(
                    "fatigue_ductility_coefficient",
                    self.fatigue_ductility_coefficient,
                    positive,
                ),
                ductility_exponent: number(
                    "fatigue_ductility_exponent",
                    self.fatigue_ductility_exponent,
                    negative,
                ),
            }
        } else {
            Law::Stress
        };
        if is_strain_law && self.mean_stress == MeanStress::Goodman {
            let misfit = Misfit::new("mean_stress", "Goodman's correction is one of stress");
            let others = "`morrow`, `smith_watson_topper`, or `law = \"stress_life\"`";
            missing.push(misfit.expected(others).found("`goodman`"));
        }
        let factor = match (is_strain_law, to_strain, to_stress) {
            (true, Some(factor), _) | (false, None, Some(factor)) => factor,
            (true, None, Some(factor)) => factor / modulus,
            (false, Some(factor), _) => factor * modulus,
            (_, None, None) => {
                let message = "damage is that of a strain or of a stress";
                let misfit =
                    Misfit::new("output", message).expected("a response in `1` or in `Pa`");
                missing.push(misfit.found(format!("`{}` in `{}`", curve.name, curve.unit)));
                f64::NAN
            }
        };
        if missing.is_empty() {
            Ok((Material { law, strength, exponent, mean }, factor))
        } else {
            Err(missing)
        }
    }
}

fn missing_key(key: &str, why: &str) -> Misfit {
    Misfit::new(key, format!("missing key `{key}`")).help(format!("{why} needs it"))
}

fn positive(key: &str, value: f64) -> Result<f64, Vec<Misfit>> {
    sound(key, value, value > 0.0, "a number above 0")
}

fn negative(key: &str, value: f64) -> Result<f64, Vec<Misfit>> {
    sound(key, value, value < 0.0, "a number below 0, such as -0.1")
}

fn sound(key: &str, value: f64, fits: bool, expected: &str) -> Result<f64, Vec<Misfit>> {
    if fits && value.is_finite() {
        return Ok(value);
    }
    let misfit = Misfit::new(key, format!("`{key}` has the wrong sign, or is no number"));
    Err(vec![misfit.expected(expected).found(value)])
}

lacuna::register!(Quantity, "rainflow", Rainflow);
