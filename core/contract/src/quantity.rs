//! Contract of quantities of interest.

use lacuna::data::{Coordinates, Unit};
use lacuna::math::random::{Stream, normal};
use lacuna::plugin::Quantity;
use lacuna::plugin::quantity::{Arguments, Curve, Functional, Misfit, Number};

use crate::judge::{Check, calm, judge, layout};

/// Tests a quantity against its contract: a quantity of a curve on a strain over five times, a quantity of numbers on the
/// numbers `a` in `m` and `b` in `s`.
///
/// - It can be computed, and the same arguments give the same value, a number or NaN.
/// - Arguments that are NaN give NaN.
/// - A curve of one point, of other units, or other numbers cause an error or a value, and no panic.
pub fn quantity(name: &str, quantity: &dyn Quantity) -> Result<(), Vec<String>> {
    let checks: [Check<'_>; 3] = [
        ("is computed", Box::new(|| is_computed(quantity))),
        ("knows what is undefined", Box::new(|| knows_what_is_undefined(quantity))),
        ("bears other arguments", Box::new(|| bears_other_arguments(quantity))),
    ];
    judge("quantity", name, &checks)
}

fn unit(text: &str) -> Unit {
    Unit::parse(text).unwrap_or_else(|_| unreachable!("`{text}` is a unit"))
}

/// The quantity of a curve on this grid, or of two numbers.
fn bound(
    quantity: &dyn Quantity,
    grid: &[f64],
    units: [&str; 2],
) -> Result<Box<dyn Functional>, Vec<Misfit>> {
    let [first, second] = units.map(unit);
    if quantity.of_curve() {
        let curve = Curve { name: "y", unit: &first, axis: "x", grid, grid_unit: &second };
        return quantity.bind(&Arguments::Curve(curve));
    }
    let numbers =
        [Number { name: "a", unit: Some(&first) }, Number { name: "b", unit: Some(&second) }];
    quantity.bind(&Arguments::Numbers(&numbers))
}

fn grid() -> Vec<f64> {
    match layout().axes.pop().map(|axis| axis.coordinates) {
        Some(Coordinates::Grid { values, .. }) => values,
        _ => Vec::new(),
    }
}

/// The quantity as the suite computes it, and the number of its arguments.
fn usual(quantity: &dyn Quantity) -> Result<(Box<dyn Functional>, usize), String> {
    let (units, count) =
        if quantity.of_curve() { (["1", "s"], grid().len()) } else { (["m", "s"], 2) };
    let found = bound(quantity, &grid(), units);
    let told = |misfits: Vec<Misfit>| {
        let words = misfits.into_iter().map(|misfit| format!("{}: {}", misfit.key, misfit.message));
        words.collect::<Vec<_>>().join("; ")
    };
    Ok((found.map_err(told)?, count))
}

fn is_computed(quantity: &dyn Quantity) -> Result<(), String> {
    let (functional, count) = usual(quantity)?;
    let mut rng = Stream::root(3).generator();
    for _ in 0..20 {
        let arguments: Vec<f64> = (0..count).map(|_| 1e-3 * normal(&mut rng)).collect();
        let value = functional.value(&arguments);
        if functional.value(&arguments).to_bits() != value.to_bits() {
            return Err(format!("{arguments:?} give {value} and then another value"));
        }
    }
    Ok(())
}

fn knows_what_is_undefined(quantity: &dyn Quantity) -> Result<(), String> {
    let (functional, count) = usual(quantity)?;
    let value = calm("a curve of NaN", || functional.value(&vec![f64::NAN; count]))?;
    if value.is_nan() { Ok(()) } else { Err(format!("arguments that are NaN give {value}")) }
}

fn bears_other_arguments(quantity: &dyn Quantity) -> Result<(), String> {
    for (grid, units) in [
        (&[0.5][..], ["1", "s"]),
        (&[0.0, 1.0], ["Pa", "m"]),
        (&[0.0, 1.0, 5.0], ["degC", "degC"]),
        (&[-1.0, 0.0, 1.0], ["kg", "1"]),
    ] {
        let count = if quantity.of_curve() { grid.len() } else { 2 };
        calm(&format!("a curve in {units:?} at {grid:?}"), || {
            if let Ok(functional) = bound(quantity, grid, units) {
                functional.value(&vec![0.25; count]);
                functional.value(&vec![0.0; count]);
                functional.value(&vec![f64::INFINITY; count]);
            }
        })?;
    }
    Ok(())
}
