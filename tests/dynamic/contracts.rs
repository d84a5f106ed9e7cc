//! The suites of the kinds, put to plugins of a library.

use lacuna::contract;
use lacuna::plugin::registry::{self, Kind};
use lacuna::plugin::{Component, Discrepancy, Sampler};

use super::twin;

/// Puts plugins of the library, with options, through a suite.
fn all<K: Kind + ?Sized>(
    table: &[(&str, &str)],
    suite: impl Fn(&str, &K) -> Result<(), Vec<String>>,
) {
    let held = &twin().plugins;
    let names: Vec<&str> =
        held.iter().filter(|(kind, _)| kind == K::NAME).map(|(_, name)| name.as_str()).collect();
    let mut tested: Vec<&str> = table.iter().map(|(name, _)| *name).collect();
    tested.dedup();
    assert_eq!(tested, names, "the plugins of kind {} that are tested here", K::NAME);
    let mut breaches = Vec::new();
    for (name, options) in table {
        let built = registry::from_text::<K>(name, options).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(built.library, Some(twin()));
        breaches.extend(suite(name, &*built.plugin).err().unwrap_or_default());
    }
    assert!(breaches.is_empty(), "{}", breaches.join("\n"));
}

/// A suite passed, and nothing went wrong that the suite did not see.
fn sound(plugin: &dyn Component, outcome: Result<(), Vec<String>>) -> Result<(), Vec<String>> {
    let fault = plugin.fault().unwrap();
    assert_eq!(fault.said(), None);
    outcome
}

#[test]
fn discrepancies() {
    let table = [
        (
            "twin_autoregressive",
            "variance = { half_normal = 1.0 }\ncorrelation_time = { log_normal = [-9, 1] }",
        ),
        ("twin_gaussian", "variance = { half_normal = 1.0 }"),
        ("twin_gaussian", "variance = { measured = { inverse_gamma = [3, 4] } }\nby = \"sensor\""),
        ("twin_gaussian", "variance = { half_normal = 1.0 }\nmarginal = true"),
        (
            "twin_gaussian_process",
            "bias = { half_normal = 1.0 }\ncorrelation_length = { log_normal = [-9, 1] }\n\
             variance = { half_normal = 1.0 }",
        ),
        ("twin_student_t", "scale = { half_normal = 1.0 }"),
    ];
    all::<dyn Discrepancy>(&table, |name, plugin| {
        sound(plugin, contract::discrepancy(name, plugin))
    });
}

#[test]
fn samplers() {
    let table = [
        ("twin_adaptive_metropolis", "steps = 4000\nwarm_up = 1000"),
        ("twin_affine_invariant_ensemble", "walkers = 40\nsteps = 2000"),
        (
            "twin_affine_invariant_ensemble",
            "walkers = 40\nsteps = 2000\nmoves = { differential_evolution = 0.8, snooker = 0.2 }",
        ),
        ("twin_nested", "live = 300"),
        ("twin_no_u_turn", "warm_up = 300"),
    ];
    all::<dyn Sampler>(&table, |name, plugin| sound(plugin, contract::sampler(name, plugin)));
}
