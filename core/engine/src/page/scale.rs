//! Scales from values to coordinates of a drawing (linear and logarithmic), ticks, and displayed units.

use lacuna::data::Unit;

use super::number::{significant, superscript};

/// Kind of a scale.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Equal differences have equal lengths.
    Linear,
    /// Equal ratios have equal lengths.
    Logarithmic,
}

/// Map from a range of values (the domain) to a range of coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scale {
    kind: Kind,
    domain: (f64, f64),
    range: (f64, f64),
}

/// Tick of an axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Tick {
    /// Value at the tick.
    pub value: f64,
    /// Label of the tick.
    pub label: String,
}

impl Scale {
    /// A linear scale. A domain of zero length, or one that is not finite, is widened.
    pub fn linear(domain: (f64, f64), range: (f64, f64)) -> Self {
        Self { kind: Kind::Linear, domain: widened(domain), range }
    }

    /// A logarithmic scale; linear if the domain is not positive.
    pub fn logarithmic(domain: (f64, f64), range: (f64, f64)) -> Self {
        if domain.0 > 0.0 && domain.1.is_finite() && domain.1 > domain.0 {
            Self { kind: Kind::Logarithmic, domain, range }
        } else {
            Self::linear(domain, range)
        }
    }

    /// Coordinate of a value; not finite if the value is not.
    pub fn place(&self, value: f64) -> f64 {
        let share = match self.kind {
            // Both terms are halved, so that the difference of very large ends does not overflow.
            Kind::Linear => {
                (0.5 * value - 0.5 * self.domain.0) / (0.5 * self.domain.1 - 0.5 * self.domain.0)
            }
            Kind::Logarithmic if value <= 0.0 => f64::NEG_INFINITY,
            Kind::Logarithmic => {
                (value / self.domain.0).ln() / (self.domain.1 / self.domain.0).ln()
            }
        };
        self.range.0 + share * (self.range.1 - self.range.0)
    }

    /// Returns true if equal ratios have equal lengths.
    pub fn is_logarithmic(&self) -> bool {
        self.kind == Kind::Logarithmic
    }

    /// Range of values of the scale.
    pub fn domain(&self) -> (f64, f64) {
        self.domain
    }

    /// About `count` ticks at round values inside the domain.
    pub fn ticks(&self, count: usize) -> Vec<Tick> {
        match self.kind {
            Kind::Linear => linear_ticks(self.domain, count),
            Kind::Logarithmic => {
                let ticks = decade_ticks(self.domain);
                if ticks.len() >= 2 { ticks } else { linear_ticks(self.domain, count) }
            }
        }
    }
}

/// Smallest interval that contains all finite values; `None` without any.
pub fn extent(values: impl IntoIterator<Item = f64>) -> Option<(f64, f64)> {
    values.into_iter().filter(|v| v.is_finite()).fold(None, |extent, v| match extent {
        None => Some((v, v)),
        Some((low, high)) => Some((f64::min(low, v), f64::max(high, v))),
    })
}

/// The interval, extended on both sides by a share of its length.
pub fn padded((low, high): (f64, f64), share: f64) -> (f64, f64) {
    let margin = share * (high - low);
    if margin.is_finite() { (low - margin, high + margin) } else { (low, high) }
}

fn widened((low, high): (f64, f64)) -> (f64, f64) {
    if !low.is_finite() || !high.is_finite() {
        return (0.0, 1.0);
    }
    let (low, high) = (low.min(high), low.max(high));
    let magnitude = low.abs().max(high.abs());
    if high - low > 1e-12 * magnitude {
        (low, high)
    } else if magnitude == 0.0 {
        (-1.0, 1.0)
    } else {
        (low - 0.05 * magnitude, high + 0.05 * magnitude)
    }
}

/// The round number next to `x`: 1, 2 or 5 times a power of ten.
///
/// Source: Heckbert, "Nice numbers for graph labels", in Graphics Gems (1990), 61-63.
fn nice(x: f64) -> f64 {
    let power = 10.0_f64.powf(x.log10().floor());
    let fraction = x / power;
    let nice = match fraction {
        f if f < 1.5 => 1.0,
        f if f < 3.0 => 2.0,
        f if f < 7.0 => 5.0,
        _ => 10.0,
    };
    nice * power
}

/// Distance between ticks for about `count` ticks on this interval.
fn spacing((low, high): (f64, f64), count: usize) -> f64 {
    nice((0.5 * high - 0.5 * low) / (count.max(2) - 1) as f64 * 2.0)
}

fn linear_ticks(domain: (f64, f64), count: usize) -> Vec<Tick> {
    let step = spacing(domain, count);
    if !step.is_finite() || step <= 0.0 {
        return Vec::new();
    }
    let first = (domain.0 / step - 1e-9).ceil();
    let last = (domain.1 / step + 1e-9).floor();
    let many = (last - first).clamp(0.0, 1000.0) as usize;
    let magnitude = domain.0.abs().max(domain.1.abs());
    let values = (0..=many).map(|i| {
        let index = first + i as f64;
        // The product of index and step has a rounding error, so it is rounded to the digits of the step.
        if index == 0.0 { 0.0 } else { index * step }
    });
    values.map(|value| Tick { value, label: tick_label(value, step, magnitude) }).collect()
}

/// A label with exactly the decimals of the step; in scientific notation if that would be long.
fn tick_label(value: f64, step: f64, magnitude: f64) -> String {
    let step_power = (step * 1.0001).log10().floor();
    let text = if (1e-4..1e6).contains(&magnitude) && step_power >= -9.0 {
        crate::page::number::fixed(value, (-step_power).max(0.0) as usize)
    } else if value == 0.0 {
        String::from("0")
    } else {
        let digits = (value.abs() * 1.0001).log10().floor() - step_power + 1.0;
        significant(value, digits.clamp(1.0, 15.0) as usize)
    };
    crate::page::number::typeset(&text)
}

/// Ticks at powers of ten; at every second or further one if there are many.
fn decade_ticks((low, high): (f64, f64)) -> Vec<Tick> {
    let first = (low.log10() - 1e-9).ceil() as i32;
    let last = (high.log10() + 1e-9).floor() as i32;
    let stride = ((last - first) / 7 + 1).max(1);
    (first..=last)
        .filter(|power| power % stride == 0)
        .map(|power| {
            let label = match power {
                -2..=3 => significant(10.0_f64.powi(power), 1),
                power => format!("10{}", superscript(&power.to_string())),
            };
            Tick { value: 10.0_f64.powi(power), label }
        })
        .collect()
}

/// Unit in which values of one quantity are displayed: an SI prefix or a power of ten is factored out, so that figures
/// and tables have short numbers. The displayed number is the value divided by `factor`.
#[derive(Debug, Clone, PartialEq)]
pub struct ShownUnit {
    /// Size of the displayed unit in the unit of the values.
    pub factor: f64,
    /// Name of the displayed unit; empty for dimensionless numbers.
    pub unit: String,
}

/// Units that take SI prefixes, by their symbol without prefix.
const PREFIXABLE: [&str; 12] = ["s", "Pa", "m", "N", "W", "J", "Hz", "V", "A", "g", "C", "Pa s"];

impl ShownUnit {
    /// The displayed unit for values of this magnitude.
    pub fn of(unit: &Unit, magnitude: f64) -> Self {
        let name = unit.to_string();
        let power = match magnitude.abs() {
            m if m.is_finite() && m > 0.0 => (m * (1.0 + 1e-12)).log10().div_euclid(3.0) as i32 * 3,
            _ => 0,
        };
        // From 0.1 to 100 000, plain numbers are easier to read than a prefix on a compound unit.
        let plain = (0.1..1e5).contains(&magnitude.abs()) || power == 0;
        match name.as_str() {
            "strain" if (-9..=-3).contains(&power) => {
                Self { factor: 1e-6, unit: String::from("microstrain") }
            }
            // Kiloseconds are not in use.
            "s" if power > 0 => Self { factor: 1.0, unit: name },
            name if PREFIXABLE.contains(&name) && prefix(power).is_some() => Self {
                factor: 10.0_f64.powi(power),
                unit: format!("{}{name}", prefix(power).unwrap_or_default()),
            },
            name if plain => Self { factor: 1.0, unit: pretty(name) },
            name => Self {
                factor: 10.0_f64.powi(power),
                unit: format!("10{} {}", superscript(&power.to_string()), pretty(name))
                    .trim_end()
                    .to_owned(),
            },
        }
    }

    /// The common displayed unit of these values.
    pub fn for_values(unit: &Unit, values: impl IntoIterator<Item = f64>) -> Self {
        let magnitude = extent(values).map_or(0.0, |(low, high)| low.abs().max(high.abs()));
        Self::of(unit, magnitude)
    }

    /// A value in the displayed unit.
    pub fn show(&self, value: f64) -> f64 {
        value / self.factor
    }

    /// Label of an axis: the name, with the unit in brackets.
    pub fn label(&self, name: &str) -> String {
        if self.unit.is_empty() { name.to_owned() } else { format!("{name} [{}]", self.unit) }
    }

    /// A value with its unit, with this many significant digits.
    pub fn text(&self, value: f64, digits: usize) -> String {
        self.join(&crate::page::number::typeset(&significant(self.show(value), digits)))
    }

    /// A formatted number that is already in the displayed unit, followed by the unit.
    pub fn join(&self, number: &str) -> String {
        let times = if self.unit.starts_with("10") { "× " } else { "" };
        format!("{number} {times}{}", self.unit).trim_end().to_owned()
    }
}

fn prefix(power: i32) -> Option<&'static str> {
    Some(match power {
        -12 => "p",
        -9 => "n",
        -6 => "µ",
        -3 => "m",
        0 => "",
        3 => "k",
        6 => "M",
        9 => "G",
        12 => "T",
        _ => return None,
    })
}

/// A unit in printed form, such as `kg/m³`; `1` for dimensionless numbers.
pub fn printed(unit: &Unit) -> String {
    let text = pretty(&unit.to_string());
    if text.is_empty() { "1".to_owned() } else { text }
}

/// A unit with integer exponents as superscripts and others as written (`kg^(1/2)`); empty for dimensionless numbers.
fn pretty(unit: &str) -> String {
    if unit == "1" {
        return String::new();
    }
    let unit = unit.replace("**", "^").replace('*', "·");
    let mut text = String::new();
    let mut rest = unit.as_str();
    while let Some(c) = rest.chars().next() {
        let after_symbol = text.ends_with(|c: char| c.is_alphabetic() || c == ')');
        let raised = rest.strip_prefix('^').unwrap_or(rest);
        let sign = usize::from(raised.starts_with('-'));
        let end = sign + raised[sign..].bytes().take_while(u8::is_ascii_digit).count();
        // A full stop without a preceding caret denotes multiplication.
        let is_broken = c == '^' && raised[end..].starts_with('.');
        if after_symbol && end > sign && !is_broken {
            text.push_str(&superscript(&raised[..end]));
            rest = &raised[end..];
        } else {
            text.push(c);
            rest = &rest[c.len_utf8()..];
        }
    }
    text.trim_end().to_owned()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn unit(text: &str) -> Unit {
        Unit::parse(text).unwrap()
    }

    fn labels(ticks: &[Tick]) -> Vec<&str> {
        ticks.iter().map(|t| t.label.as_str()).collect()
    }

    /// Heckbert (1990), page 61: data from 105 to 543 want ticks every 100 units, data from 2.04 to
    /// 2.16 a spacing of 0.05 (his plots run to the next tick outside; ours stay inside the data).
    #[test]
    fn ticks_are_at_nice_numbers_as_heckbert_places_them() {
        assert_eq!(spacing((105.0, 543.0), 5), 100.0);
        let ticks = Scale::linear((100.0, 600.0), (0.0, 1.0)).ticks(6);
        assert_eq!(labels(&ticks), ["100", "200", "300", "400", "500", "600"]);
        let ticks = Scale::linear((2.0, 2.2), (0.0, 1.0)).ticks(5);
        assert_eq!(labels(&ticks), ["2.00", "2.05", "2.10", "2.15", "2.20"]);
    }

    #[test]
    fn ticks_lie_inside_the_domain_in_order_for_any_magnitude() {
        for domain in [(-1e-300, 1e-300), (0.0, 1e300), (12_111.0, 12_111.000_1), (-7.0, 1e9)] {
            let scale = Scale::linear(domain, (0.0, 500.0));
            let ticks = scale.ticks(5);
            assert!((2..=12).contains(&ticks.len()), "{domain:?}: {ticks:?}");
            assert!(ticks.windows(2).all(|t| t[0].value < t[1].value && t[0].label != t[1].label));
            for tick in &ticks {
                assert!((-0.01..=500.01).contains(&scale.place(tick.value)), "{domain:?}");
            }
        }
    }

    #[test]
    fn a_domain_without_length_is_widened() {
        for domain in [(0.0, 0.0), (5.0, 5.0), (f64::NAN, 1.0), (f64::NEG_INFINITY, 3.0)] {
            let scale = Scale::linear(domain, (0.0, 100.0));
            assert!(scale.place(scale.domain().0).is_finite());
            assert!(scale.domain().0 < scale.domain().1);
            assert!(!scale.ticks(5).is_empty());
        }
        let widest = Scale::linear((-f64::MAX, f64::MAX), (0.0, 100.0));
        assert!((widest.place(0.0) - 50.0).abs() < 1e-9);
    }

    #[test]
    fn logarithmic_ticks_are_powers_of_ten() {
        let ticks = Scale::logarithmic((0.05, 2000.0), (0.0, 1.0)).ticks(5);
        assert_eq!(labels(&ticks), ["0.1", "1", "10", "100", "1000"]);
        let ticks = Scale::logarithmic((1e-9, 1e9), (0.0, 1.0)).ticks(5);
        assert_eq!(labels(&ticks), ["10⁻⁹", "10⁻⁶", "10⁻³", "1", "1000", "10⁶", "10⁹"]);
        assert_eq!(Scale::logarithmic((0.0, 1.0), (0.0, 1.0)).kind, Kind::Linear);
    }

    #[test]
    fn units_take_prefixes_and_powers_of_ten() {
        let shown = |u: &str, m: f64| ShownUnit::of(&unit(u), m).label("x");
        assert_eq!(shown("Pa", 65_000.0), "x [kPa]");
        assert_eq!(shown("Pa", 1.5e7), "x [MPa]");
        assert_eq!(shown("s", 1e-3), "x [ms]");
        assert_eq!(shown("kg/m3", 12_111.0), "x [kg/m³]");
        assert_eq!(shown("m/s", 1850.0), "x [m/s]");
        assert_eq!(shown("1", 3e-4), "x [10⁻⁶]");
        assert_eq!(shown("strain", 3e-4), "x [microstrain]");
        assert_eq!(shown("1", 0.5), "x");
        assert_eq!(shown("strain^2", 1e-9), "x [10⁻⁹ strain²]");
        assert_eq!(shown("(m3/d)^2", 25.0), "x [(m³/d)²]");
        assert_eq!(shown("1/s", 25.0), "x [1/s]");
        assert_eq!(shown("kPa", 3.0), "x [kPa]");
        assert_eq!(
            ["kg/m3", "J/(kg K)", "1"].map(|u| printed(&unit(u))),
            ["kg/m³", "J/(kg K)", "1"]
        );
        assert_eq!(
            ["kg^(1/2)/(m s)", "Hz^0.5", "m^-2 s2.A", "(m/s)^3"].map(|u| printed(&unit(u))),
            ["kg^(1/2)/(m s)", "Hz^0.5", "m⁻² s².A", "(m/s)³"]
        );
        assert_eq!(shown("Pa", 0.0), "x [Pa]");
        assert_eq!(ShownUnit::of(&unit("Pa"), 6.5e4).text(64_873.0, 3), "64.9 kPa");
        assert_eq!(ShownUnit::of(&unit("1"), 6e-5).text(5.8e-5, 2), "58 × 10⁻⁶");
    }
}
