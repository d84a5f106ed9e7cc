//! Fatigue of the true strain of `configs/sns-fatigue`, against the package `rainflow`.

use std::fs;

use lacuna::data::Unit;
use lacuna::plugin::quantity::{Arguments, Curve};

use crate::quick;

/// The quantities of the study have the values that `truth.py` computed with the package `rainflow` 3.2 and its own
/// solution of the law of strain and life.
#[test]
fn damage_of_the_truth_is_that_of_another_program() {
    let folder = quick::root().join("configs/sns-fatigue");
    let study = quick::load(&folder.join("study.toml"), &[]);
    let truth = fs::read_to_string(folder.join("truth.csv")).unwrap();
    let expected = fs::read_to_string(folder.join("damage.csv")).unwrap();
    let [strain, seconds] = ["strain", "s"].map(|unit| Unit::parse(unit).unwrap());
    let mut count = 0;
    for line in expected.lines().skip(1) {
        let fields: Vec<&str> = line.split(',').collect();
        let &[energy, sensor, damage, range] = &fields[..] else { panic!("{line}") };
        let own = format!("next,{energy},{sensor},");
        let rows = truth.lines().filter_map(|line| line.strip_prefix(&own)?.split_once(','));
        let (grid, values): (Vec<f64>, Vec<f64>) = rows
            .map(|(time, strain)| {
                (time.parse::<f64>().unwrap(), 1e-6 * strain.parse::<f64>().unwrap())
            })
            .unzip();
        assert_eq!(grid.len(), 100, "{line}");
        let curve =
            Curve { name: "strain", unit: &strain, axis: "time", grid: &grid, grid_unit: &seconds };
        for (name, expected, scale) in [("damage", damage, 1.0), ("range", range, 1e-6)] {
            let quantity =
                study.quantities.iter().find(|q| q.common.name.as_str() == name).unwrap();
            let found = quantity.built.plugin.bind(&Arguments::Curve(curve)).unwrap();
            let expected = scale * expected.parse::<f64>().unwrap();
            let error = found.value(&values) / expected - 1.0;
            assert!(error.abs() < 1e-6, "{name}, {line}: {error}");
            count += 1;
        }
    }
    assert_eq!(count, 40);
}
