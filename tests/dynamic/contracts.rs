//! The suites of the kinds, applied to plugins of a library.

use lacuna::data::{Axis, Layout, Parameter, Scenario, Unit};
use lacuna::math::distribution::Distribution;
use lacuna::plugin::quantity::{Arguments, Number};
use lacuna::plugin::registry::{self, Kind};
use lacuna::plugin::{
    Component, Context, Design, Discrepancy, Effect, Given, Model, Quantity, Reader, Sampler,
    Surrogate,
};
use lacuna_contract::Sample;

use super::twin;

/// Runs plugins of the library, with options, through a suite.
fn all<K: Kind + ?Sized>(
    table: &[(&str, &str)],
    suite: impl Fn(&str, &K) -> Result<(), Vec<String>>,
) {
    let held = &twin().plugins;
    let names: Vec<&str> = held
        .iter()
        .filter(|(kind, name)| kind == K::NAME && name.starts_with("twin_"))
        .map(|(_, name)| name.as_str())
        .collect();
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

/// Requires that a suite passed and no fault occurred that the suite did not see.
pub fn sound(plugin: &dyn Component, outcome: Result<(), Vec<String>>) -> Result<(), Vec<String>> {
    let [fault] = &plugin.faults()[..] else { panic!("a plugin of a library may have a fault") };
    assert_eq!(fault.said(), None);
    outcome
}

#[test]
fn designs() {
    let table = [("twin_latin_hypercube", ""), ("twin_quadrature", "")];
    all::<dyn Design>(&table, |name, plugin| sound(plugin, lacuna_contract::design(name, plugin)));
}

#[test]
fn effects() {
    let table = [("twin_delay", "time = { normal = [0, 1e-5] }"), ("twin_gain", "")];
    all::<dyn Effect>(&table, |name, plugin| sound(plugin, lacuna_contract::effect(name, plugin)));
}

#[test]
fn surrogates() {
    let table = [
        ("twin_gaussian_process", "nugget = 1e-8"),
        ("twin_polynomial_chaos", "degree = { max = 8 }"),
    ];
    all::<dyn Surrogate>(&table, |name, plugin| {
        sound(plugin, lacuna_contract::surrogate(name, plugin))
    });
}

/// The suite of models, in a study of two parameters and five times.
pub fn model(name: &str, plugin: &dyn Model) -> Result<(), Vec<String>> {
    let parameters =
        ["a", "b"].map(|name| Parameter::plain(name, Distribution::Uniform([0.0, 2.0])));
    let given =
        parameters.clone().map(|p| Given { name: p.name.clone(), unit: Some(p.unit.clone()) });
    let scenarios = [Scenario::default()];
    let axes =
        vec![Axis::grid("time", (1..=5).map(f64::from).collect(), Unit::parse("s").unwrap())];
    let layout = Layout { name: "y".to_owned(), unit: Unit::dimensionless(), axes };
    let scratch = tempfile::tempdir().unwrap();
    let context = Context {
        given: &given,
        scenarios: &scenarios,
        ..Context::new(scratch.path(), &parameters, &layout)
    };
    lacuna_contract::model(name, plugin, &context, scratch.path())
}

#[test]
fn models() {
    let table = [
        ("twin_equations", "observe = \"a + sin(b * time / 1 {s}) + b\""),
        ("twin_mercury_target", "numerics = { mesh = [6, 24] }"),
    ];
    all::<dyn Model>(&table, |name, plugin| sound(plugin, model(name, plugin)));
}

/// The suite of readers, with a table whose name ends in `ending`.
pub fn reader(name: &str, plugin: &dyn Reader, ending: &str) -> Result<(), Vec<String>> {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join(format!("sound.{ending}"));
    let axes = vec![
        Axis::labels("sensor", ["A", "B"]),
        Axis::grid("time", vec![1.0, 2.0, 3.0], Unit::parse("s").unwrap()),
    ];
    let layout = Layout { name: "strain".to_owned(), unit: Unit::dimensionless(), axes };
    let values = vec![0.5, -1.0, 2.0, 3.25, 4.0, 5.5];
    let row = |i: usize| format!("{},{},{}\n", ["A", "B"][i / 3], 1 + i % 3, values[i]);
    let rows: String = (0..6).map(row).collect();
    std::fs::write(&file, format!("sensor,time,strain\n{rows}")).unwrap();
    let sample = Sample { file, layout, values, tolerance: 0.0 };
    let scratch = tempfile::tempdir().unwrap();
    lacuna_contract::reader(name, plugin, &sample, scratch.path())
}

#[test]
fn readers() {
    all::<dyn Reader>(&[("twin_csv", "")], |name, plugin| {
        sound(plugin, reader(name, plugin, "csv"))
    });
}

#[test]
fn quantities() {
    let steel = "fatigue_strength_coefficient = { value = 1000, unit = \"MPa\" }\n\
                 fatigue_strength_exponent = -0.1\nmodulus = { value = 200, unit = \"GPa\" }";
    let table =
        [("twin_expression", "formula = \"sqrt(a * 1 {m}) + a\""), ("twin_rainflow", steel)];
    all::<dyn Quantity>(&table, |name, plugin| {
        sound(plugin, lacuna_contract::quantity(name, plugin))
    });
}

/// Options that do not fit the arguments are reported by the library, each with its key and the place inside the text.
#[test]
fn the_options_of_a_quantity_that_do_not_fit_are_told() {
    let metre = Unit::parse("m").unwrap();
    let numbers = [Number { name: "a", unit: Some(&metre) }];
    let misfits = |name: &str| {
        let built = registry::from_text::<dyn Quantity>(name, "formula = \"a + speed\"").unwrap();
        built.plugin.bind(&Arguments::Numbers(&numbers)).err().unwrap()
    };
    twin();
    let told = misfits("twin_expression");
    assert_eq!(told, misfits("expression"));
    assert_eq!(told[0].part, Some(4..9), "{told:?}");
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
        sound(plugin, lacuna_contract::discrepancy(name, plugin))
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
    all::<dyn Sampler>(&table, |name, plugin| {
        sound(plugin, lacuna_contract::sampler(name, plugin))
    });
}
