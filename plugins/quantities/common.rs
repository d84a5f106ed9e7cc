//! Computations on curves that several quantities share.

/// Returns the integral over a grid by the trapezoidal rule; zero on a single point.
pub fn trapezoid(grid: &[f64], value: impl Fn(usize) -> f64) -> f64 {
    let interval = |i: usize| 0.5 * (grid[i + 1] - grid[i]) * (value(i) + value(i + 1));
    (0..grid.len().saturating_sub(1)).map(interval).sum()
}

/// Returns the average over a grid by the trapezoidal rule: on an uneven grid every value counts by the length that it
/// stands for. On a single point it is the value there.
pub fn average(grid: &[f64], value: impl Fn(usize) -> f64) -> f64 {
    match grid {
        [] => f64::NAN,
        [_] => value(0),
        [first, .., last] => trapezoid(grid, value) / (last - first),
    }
}

/// Returns the index of the largest value, the first of equal ones; `None` without values or if one is NaN.
pub fn largest(values: impl Iterator<Item = f64>) -> Option<usize> {
    let mut best: Option<(usize, f64)> = None;
    for (i, y) in values.enumerate() {
        if y.is_nan() {
            return None;
        }
        if best.is_none_or(|(_, most)| y > most) {
            best = Some((i, y));
        }
    }
    best.map(|(i, _)| i)
}

/// Returns the largest value; NaN without values or if one is NaN.
pub fn maximum(values: impl Iterator<Item = f64> + Clone) -> f64 {
    largest(values.clone()).and_then(|i| values.clone().nth(i)).unwrap_or(f64::NAN)
}

#[cfg(test)]
pub(super) mod testing {
    #![allow(clippy::unwrap_used)]

    use lacuna::data::Unit;
    use lacuna::plugin::quantity::{Arguments, Curve, Misfit};
    use lacuna::plugin::{Quantity, registry};

    /// Value and unit of a quantity with these options on a strain curve over seconds.
    pub fn value(name: &str, options: &str, grid: &[f64], values: &[f64]) -> (f64, String) {
        value_in(name, options, ["1", "s"], grid, values).unwrap()
    }

    /// Like [`value`], in the given units of values and grid.
    pub fn value_in(
        name: &str,
        options: &str,
        units: [&str; 2],
        grid: &[f64],
        values: &[f64],
    ) -> Result<(f64, String), Vec<Misfit>> {
        let [unit, grid_unit] = units.map(|text| Unit::parse(text).unwrap());
        let plugin = registry::from_text::<dyn Quantity>(name, options).unwrap().plugin;
        let curve = Curve { name: "y", unit: &unit, axis: "time", grid, grid_unit: &grid_unit };
        let functional = plugin.bind(&Arguments::Curve(curve))?;
        Ok((functional.value(values), functional.unit().to_string()))
    }
}
