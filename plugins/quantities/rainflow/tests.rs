//! Rainflow counting and lives against published figures and other programs.
#![allow(clippy::unwrap_used)]

use super::super::common::testing::{value, value_in};
use super::{Cycle, Law, Material, Mean, cycles};

/// Number of cycles of each range, the smallest range first.
fn counted(values: &[f64]) -> Vec<(f64, f64)> {
    let mut all: Vec<(f64, f64)> = Vec::new();
    for cycle in cycles(values).unwrap() {
        match all.iter_mut().find(|(range, _)| *range == cycle.range) {
            Some((_, count)) => *count += cycle.count,
            None => all.push((cycle.range, cycle.count)),
        }
    }
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    all
}

/// ASTM E1049-85 (2017), section 5.4.4 and figure 6.
#[test]
fn the_example_of_the_standard_is_counted() {
    let record = [-2.0, 1.0, -3.0, 5.0, -1.0, 3.0, -4.0, 4.0, -2.0];
    assert_eq!(counted(&record), [(3.0, 0.5), (4.0, 1.5), (6.0, 0.5), (8.0, 1.0), (9.0, 0.5)]);
    // The closed cycle of the standard is that from E to F, from -1 to 3.
    let closed = cycles(&record).unwrap().into_iter().find(|cycle| cycle.count == 1.0);
    assert_eq!(closed, Some(Cycle { range: 4.0, mean: 1.0, count: 1.0 }));
    // Points between the reversals, and values that stay, change nothing.
    let slower = [-2.0, -2.0, 0.0, 1.0, -3.0, 0.0, 5.0, 5.0, 5.0, -1.0, 3.0, -4.0, 4.0, 1.0, -2.0];
    assert_eq!(cycles(&slower), cycles(&record));
}

/// `rainflow` 3.2.0 (`PyPI`, Janiszewski), `extract_cycles`, for
/// `y = [round(3*sin(0.9*i) + 2*cos(2.3*i + 1) + 0.5*sin(7.1*i), 3) for i in range(40)]`.
#[test]
fn a_longer_record_is_counted_as_by_another_program() {
    let y = |i: f64| {
        let y = 3.0 * (0.9 * i).sin() + 2.0 * (2.3 * i + 1.0).cos() + 0.5 * (7.1 * i).sin();
        (y * 1000.0).round() / 1000.0
    };
    let record: Vec<f64> = (0..40).map(|i| y(f64::from(i))).collect();
    let found = cycles(&record).unwrap();
    let sum = |of: &dyn Fn(&Cycle) -> f64| found.iter().map(|c| c.count * of(c)).sum::<f64>();
    assert_eq!((found.len(), sum(&|_| 1.0)), (17, 12.5));
    for (figure, expected) in [
        (sum(&|c| c.range), 53.972),
        (sum(&|c| c.range.powi(3)), 3_123.749_421_146),
        (sum(&|c| c.range.powi(5)), 239_499.322_479_806_14),
        (sum(&|c| c.range * c.mean), 6.538_984_500_000_002),
    ] {
        assert!((figure / expected - 1.0).abs() < 1e-9, "{figure} {expected}");
    }
}

#[test]
fn short_and_broken_records_are_borne() {
    assert_eq!(cycles(&[]), Some(vec![]));
    assert_eq!(cycles(&[1.0]), Some(vec![]));
    assert_eq!(cycles(&[1.0, 1.0]), Some(vec![]));
    assert_eq!(counted(&[1.0, 4.0]), [(3.0, 0.5)]);
    assert_eq!(cycles(&[1.0, f64::NAN, 2.0]), None);
    assert_eq!(value("rainflow", "output = \"range\"", &[0.0, 1.0], &[1.0, 1.0]).0, 0.0);
}

const STEEL: Material =
    Material { law: Law::Stress, strength: 1000e6, exponent: -0.114, mean: Mean::None };
const MODULUS: f64 = 193e9;

/// `SciPy` 1, `brentq` on the logarithm of both sides to 1e-15: strain amplitude, mean stress, `ln 2N` without correction and
/// with those of Morrow and of Smith, Watson and Topper.
#[test]
fn the_strain_life_is_solved() {
    let law = Law::Strain { modulus: MODULUS, ductility: 0.171, ductility_exponent: -0.402 };
    let never = f64::INFINITY;
    for (amplitude, mean, expected) in [
        (1e-4, -100e6, [34.641_950_743_767_93, 35.474_181_160_234_74, never]),
        (1e-4, 200e6, [34.641_950_743_767_93, 32.700_471_134_636_71, 24.106_736_433_908_203]),
        (5e-4, 0.0, [21.143_517_424_524_013, 21.143_517_424_524_013, 20.853_582_601_065_37]),
        (2e-3, -100e6, [13.197_239_084_009_832, 13.443_540_949_443_332, 12.490_302_474_857_51]),
        (2e-3, 200e6, [13.197_239_084_009_832, 12.721_640_433_315_956, 10.622_370_070_853_06]),
        (1e-2, 200e6, [7.668_255_134_517_785, 7.542_237_511_220_51, 4.225_530_924_220_007]),
        (5e-2, 0.0, [3.243_601_711_449_569_4, 3.243_601_711_449_569_4, -1.977_360_817_041_513_6]),
    ] {
        for (correction, expected) in
            [Mean::None, Mean::Morrow, Mean::SmithWatsonTopper].into_iter().zip(expected)
        {
            let found = Material { law, mean: correction, ..STEEL }
                .log_reversals(amplitude, mean / MODULUS);
            let same = found == expected || (found - expected).abs() < 1e-11 * expected.abs();
            assert!(same, "{correction:?} {amplitude} {mean}: {found} {expected}");
        }
    }
}

/// Basquin's law and its corrections in closed form.
#[test]
fn the_stress_life_is_a_power() {
    let life = |mean: Mean, m: f64| 1.0 / Material { mean, ..STEEL }.damage(200e6, m);
    let power = |ratio: f64| 0.5 * ratio.powf(-1.0 / 0.114);
    for (found, expected) in [
        (life(Mean::None, 300e6), power(0.2)),
        (life(Mean::Goodman(600e6), 300e6), power(0.4)),
        (life(Mean::Morrow, 300e6), power(0.2 / 0.7)),
        (life(Mean::SmithWatsonTopper, 300e6), power(0.1_f64.sqrt())),
    ] {
        assert!((found / expected - 1.0).abs() < 1e-12, "{found} {expected}");
    }
    let of = |mean: Mean, m: f64| Material { mean, ..STEEL }.damage(200e6, m);
    assert!(of(Mean::Goodman(600e6), 600e6).is_nan() && of(Mean::Morrow, 1000e6).is_nan());
    assert_eq!(of(Mean::SmithWatsonTopper, -200e6), 0.0);
    assert_eq!(STEEL.damage(0.0, 1e8), 0.0);
}

const OPTIONS: &str = "fatigue_strength_coefficient = { value = 1000, unit = \"MPa\" }\n\
                       fatigue_strength_exponent = -0.1\nmodulus = { value = 200, unit = \"GPa\" }";

/// Damage of a record in microstrain, in strain and in stress is the same, and that of Miner's sum.
#[test]
fn damage_adds_up_in_any_unit() {
    let grid: Vec<f64> = (0..9).map(f64::from).collect();
    let strain = [-2.0, 1.0, -3.0, 5.0, -1.0, 3.0, -4.0, 4.0, -2.0].map(|y| 1e-4 * y);
    let in_unit = |unit: &str, factor: f64| {
        let values = strain.map(|y| factor * y);
        value_in("rainflow", OPTIONS, [unit, "s"], &grid, &values).unwrap().0
    };
    let one = |range: f64| 2.0 * (0.5 * range * 1e-4 * 200e9 / 1000e6_f64).powf(10.0);
    let sum = 0.5 * one(3.0) + 1.5 * one(4.0) + 0.5 * one(6.0) + one(8.0) + 0.5 * one(9.0);
    for found in [in_unit("1", 1.0), in_unit("microstrain", 1e6), in_unit("MPa", 200e3)] {
        assert!((found / sum - 1.0).abs() < 1e-12, "{found} {sum}");
    }
    let cycles = "output = \"cycles\"\nleast_range = 5e-4";
    assert_eq!(value("rainflow", cycles, &grid, &strain).0, 2.0);
    let range = value("rainflow", "output = \"range\"", &grid, &strain);
    assert!((range.0 - 9e-4).abs() < 1e-18);
}

#[test]
fn constants_that_do_not_fit_are_refused() {
    for (unit, options, key) in [
        ("1", "modulus = { value = 1, unit = \"GPa\" }", "fatigue_strength_coefficient"),
        ("m", OPTIONS, "output"),
        ("1", &format!("{OPTIONS}\nlaw = \"strain_life\""), "fatigue_ductility_coefficient"),
        ("1", &format!("{OPTIONS}\nmean_stress = \"goodman\""), "ultimate_strength"),
        ("1", &OPTIONS.replace("-0.1", "0.1"), "fatigue_strength_exponent"),
        ("1", &OPTIONS.replace("\"MPa\"", "\"m\""), "fatigue_strength_coefficient"),
        ("1", &OPTIONS.replace("{ value = 200, unit = \"GPa\" }", "200e9"), "modulus"),
        ("1", "output = \"cycles\"\nleast_range = { value = 1, unit = \"s\" }", "least_range"),
    ] {
        let found = value_in("rainflow", options, [unit, "s"], &[0.0, 1.0], &[0.0, 1.0]);
        let keys: Vec<String> = found.unwrap_err().into_iter().map(|misfit| misfit.key).collect();
        assert!(keys.iter().any(|found| found == key), "{options}: {keys:?}");
    }
}
