//! Reliability methods.

use lacuna::plugin::Reliability;

use super::{Table, all};

#[test]
fn reliability() {
    let table: &Table = &[
        (
            "active_kriging",
            &["final_samples = 5000", "final_samples = 5000\nbatch = 3\nchecks = 2"],
        ),
        ("form", &["", "design_points = 1"]),
        ("importance_sampling", &["", "batch = 50"]),
        ("monte_carlo", &["", "samples = 5000"]),
        ("sorm", &["", "formula = \"breitung\"", "formula = \"tvedt\""]),
        ("subset_simulation", &["", "level_probability = 0.25\nsamples = 1000"]),
    ];
    all::<dyn Reliability>(table, |case, plugin| lacuna_contract::reliability(&case.label, plugin));
}
