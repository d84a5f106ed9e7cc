//! `band`: the part of a curve in a band of frequencies.

use lacuna::data::Unit;
use lacuna::plugin::quantity::{Arguments, Curve, Functional, Misfit, functional, in_unit};
use lacuna::plugin::{Component, Quantity};
use lacuna::text::quantity;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::spectrum::Spectrum;

/// Band: root mean square of the part of a curve in a band of frequencies.
///
/// ```text
/// rms² = Σ |Y(f)|² / n²   over the frequencies f of the discrete Fourier transform Y with low ≤ |f| ≤ high
/// ```
///
/// Over all frequencies this is the mean square of the `n` values (Parseval's theorem). The points must be evenly spaced;
/// the frequencies are `1 / (n Δ)` apart for points `Δ` apart. No taper is applied: a record that does not end as it
/// begins leaks into neighbouring frequencies.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Band {
    /// Lowest and highest frequency of the band: numbers in the inverse unit of the axis, or with a unit as in
    /// `[{ value = 1, unit = "kHz" }, { value = 5, unit = "kHz" }]`.
    pub frequency: [quantity::Quantity; 2],
}

impl Component for Band {}

/// Largest deviation of a step from the mean step, as a share of it, of evenly spaced points.
const UNEVEN: f64 = 1e-3;

/// Mean step of an evenly spaced grid.
fn step(curve: &Curve<'_>) -> Result<f64, Vec<Misfit>> {
    let grid = curve.grid;
    let mean = (grid[grid.len() - 1] - grid[0]) / (grid.len() as f64 - 1.0);
    let even = |pair: &[f64]| (pair[1] - pair[0] - mean).abs() <= UNEVEN * mean;
    if grid.len() < 2 {
        return Err(vec![Misfit::new("use", "a curve of one point has no spectrum")]);
    }
    if !grid.windows(2).all(even) {
        let message =
            format!("a spectrum needs evenly spaced points, and those of `{}` are not", curve.axis);
        let misfit = Misfit::new("use", message);
        return Err(vec![misfit.help("state a `window` in which they are, or use `rms`")]);
    }
    Ok(mean)
}

impl Quantity for Band {
    fn bind(&self, arguments: &Arguments<'_>) -> Result<Box<dyn Functional>, Vec<Misfit>> {
        let curve = arguments.curve()?;
        let step = step(&curve)?;
        let Some(inverse) = curve.grid_unit.power(-1.0).map(Unit::plain) else {
            let message = format!("an axis in `{}` has no frequencies", curve.grid_unit);
            return Err(vec![Misfit::new("use", message)]);
        };
        let ends = [0, 1].map(|k| in_unit("frequency", &self.frequency[k], &inverse));
        let [low, high] = ends;
        let (low, high) = (low?, high?);
        let length = curve.grid.len();
        let apart = 1.0 / (length as f64 * step);
        let most = length / 2;
        // A frequency that lies on an end but for round-off belongs to the band.
        let slack = 1e-9 * apart;
        let bins: Vec<usize> = (0..=most)
            .filter(|&k| (low - slack..=high + slack).contains(&(k as f64 * apart)))
            .collect();
        if !(low >= 0.0 && low <= high) || bins.is_empty() {
            let message = "the band holds no frequency of the curve";
            let expected = format!(
                "two frequencies in order, at least {apart:.3e} {inverse} apart, from 0 to {:.3e} {inverse}",
                most as f64 * apart
            );
            let found = format!("{low} to {high} {inverse}");
            let misfit = Misfit::new("frequency", message);
            return Err(vec![misfit.expected(expected).found(found)]);
        }
        let spectrum = Spectrum::new(length);
        let unit = if bins[0] == 0 { curve.unit.clone() } else { curve.unit.difference() };
        Ok(functional(unit, move |values| {
            let powers = spectrum.powers(values);
            // All frequencies but zero and the highest one of an even number stand for a pair.
            let weight = |k: usize| if k == 0 || 2 * k == length { 1.0 } else { 2.0 };
            let sum: f64 = bins.iter().map(|&k| weight(k) * powers[k]).sum();
            sum.sqrt() / length as f64
        }))
    }
}

lacuna::register!(Quantity, "band", Band);

#[cfg(test)]
mod tests {
    use super::super::common::testing::{value, value_in};

    fn record(n: usize) -> (Vec<f64>, Vec<f64>) {
        let grid: Vec<f64> = (0..n).map(|i| 0.01 * i as f64).collect();
        let tau = std::f64::consts::TAU;
        let y = |t: &f64| 2.0 + 3.0 * (tau * 5.0 * t).sin() + (tau * 20.0 * t + 0.3).cos();
        let values = grid.iter().map(y).collect();
        (grid, values)
    }

    #[test]
    fn a_sine_is_in_its_band_alone() {
        let (grid, values) = record(100);
        let rms = |band: &str| value("band", &format!("frequency = {band}"), &grid, &values).0;
        assert!((rms("[4, 6]") - 3.0 / 2.0_f64.sqrt()).abs() < 1e-12);
        assert!((rms("[15, 50]") - 1.0 / 2.0_f64.sqrt()).abs() < 1e-12);
        assert!(rms("[7, 18]") < 1e-12);
        assert!((rms("[0, 0]") - 2.0).abs() < 1e-12);
        let in_kilohertz = "[{ value = 0.004, unit = \"kHz\" }, { value = 6, unit = \"Hz\" }]";
        assert!((rms(in_kilohertz) - 3.0 / 2.0_f64.sqrt()).abs() < 1e-12);
    }

    /// Parseval's theorem, for even, odd and prime numbers of points.
    #[test]
    fn all_bands_together_are_the_mean_square() {
        for n in [2, 3, 16, 97, 100, 210] {
            let (grid, values) = record(n);
            let whole = value("band", "frequency = [0, 50]", &grid, &values).0;
            let square: f64 = values.iter().map(|y| y * y).sum::<f64>() / n as f64;
            assert!((whole * whole - square).abs() < 1e-12 * square, "{n}");
        }
    }

    /// `NumPy` 2: `y = np.arange(7.0)**2; Y = np.fft.rfft(y); np.sqrt(2*(abs(Y[1])**2 + abs(Y[2])**2))/7`.
    #[test]
    fn a_parabola_has_the_spectrum_that_numpy_finds() {
        let grid: Vec<f64> = (0..7).map(f64::from).collect();
        let values: Vec<f64> = grid.iter().map(|t| t * t).collect();
        let found = value("band", "frequency = [0.1, 0.3]", &grid, &values).0;
        assert!((found - NUMPY).abs() < 1e-12, "{found}");
    }

    const NUMPY: f64 = 11.706_189_986_690_847;

    #[test]
    fn uneven_points_and_empty_bands_are_refused() {
        let key = |options: &str, grid: &[f64]| {
            let found = value_in("band", options, ["1", "s"], grid, &vec![0.0; grid.len()]);
            found.map_err(|misfits| misfits[0].key.clone())
        };
        assert_eq!(key("frequency = [0, 1]", &[0.0, 1.0, 3.0]), Err("use".to_owned()));
        for band in ["[0.6, 0.9]", "[0.4, 0.2]", "[-1, 0.2]", "[0, { value = 1, unit = \"s\" }]"] {
            let options = format!("frequency = {band}");
            let found = key(&options, &[0.0, 1.0, 2.0, 3.0]);
            assert_eq!(found, Err("frequency".to_owned()), "{band}");
        }
    }
}
