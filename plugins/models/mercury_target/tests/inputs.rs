//! One study, three models: inputs that they list, accept and use.

use std::path::Path;

use lacuna::data::{Axis, Layout, Scenario, Unit};
use lacuna::plugin::model::{Call, EvalError, Response};
use lacuna::plugin::{Context, Given, Model, registry};

const NAMES: [&str; 3] =
    ["mercury_target", "mercury_target_equilibrium_gas", "mercury_target_bubbles"];

fn model(name: &str) -> Box<dyn Model> {
    registry::from_text::<dyn Model>(name, "numerics = { mesh = [6, 24] }").unwrap().plugin
}

fn layout() -> Layout {
    let times = (1..=30).map(|i| f64::from(i) * 1e-5).collect();
    let axes = vec![
        Axis::labels("sensor", ["T", "B"]),
        Axis::grid("time", times, Unit::parse("s").unwrap()),
    ];
    Layout { name: "strain".to_owned(), unit: Unit::dimensionless(), axes }
}

fn listed(name: &str, given: &[&str]) -> Vec<String> {
    let layout = layout();
    let given: Vec<Given> =
        given.iter().map(|name| Given { name: (*name).to_owned(), unit: None }).collect();
    let context = Context { given: &given, ..Context::new(Path::new(""), &[], &layout) };
    model(name).signature(&context).inputs.into_iter().map(|input| input.name).collect()
}

fn respond(name: &str, inputs: &[(&str, f64)]) -> Result<Response, EvalError> {
    let all = [("density", 13_500.0), ("sound_speed", 1456.0), ("tensile_cutoff", 1.5e5)];
    let all = || all.iter().chain(inputs);
    let (names, values): (Vec<String>, Vec<f64>) =
        all().map(|&(name, value)| (name.to_owned(), value)).unzip();
    let (layout, scenario) = (layout(), Scenario::default());
    let call = Call::new(&values, &names, &layout, &scenario);
    model(name).predict(&call)
}

fn values(name: &str, inputs: &[(&str, f64)]) -> Vec<f64> {
    respond(name, inputs).unwrap().values
}

#[test]
fn each_model_lists_its_own_inputs_and_those_that_a_study_sets() {
    let mercury = ["density", "sound_speed", "tensile_cutoff"];
    assert_eq!(listed("mercury_target", &[]), mercury);
    let gas = listed("mercury_target_equilibrium_gas", &[]);
    let bubbles = listed("mercury_target_bubbles", &[]);
    assert_eq!((gas.len(), bubbles.len()), (14, 15));
    assert!(!gas.contains(&"bubble_radius".to_owned()));
    let given = ["bubble_radius", "damping", "void_fraction", "viscosity"];
    let more = listed("mercury_target", &given);
    assert_eq!(more[3..], ["void_fraction", "bubble_radius", "damping"]);
    assert_eq!(listed("mercury_target_equilibrium_gas", &given).len(), 15);
}

#[test]
fn without_gas_and_damping_all_three_are_one_to_the_last_bit() {
    let base = values("mercury_target", &[]);
    for name in NAMES {
        let inputs = [("void_fraction", 0.0), ("damping", 0.0), ("bubble_radius", 1e-4)];
        assert_eq!(values(name, &inputs), base, "{name}");
    }
}

#[test]
fn inputs_of_the_vessel_count_in_every_model_and_those_of_the_gas_where_there_is_gas() {
    let changes = [
        ("damping", 500.0),
        ("pulse_energy", 1.1),
        ("beam_width", 0.03),
        ("wall_thickness", 1.1),
        ("rear_reflection", 0.3),
        ("void_fraction", 1e-4),
        ("void_gradient", 0.5),
        ("void_depletion", 0.5),
        ("ambient_pressure", 2e5),
        ("polytropic_index", 1.2),
        ("bubble_radius", 2e-4),
    ];
    for (k, name) in NAMES.into_iter().enumerate() {
        let base = values(name, &[]);
        for (i, change) in changes.into_iter().enumerate() {
            let response = respond(name, &[change]).unwrap();
            let counts = i < [5, 10, 11][k];
            assert_eq!(response.values != base, counts, "{name} {}", change.0);
            let idle = response.facts.iter().find(|fact| fact.name == "inputs without effect");
            let expected = (!counts).then(|| change.0.to_owned());
            assert_eq!(idle.map(|fact| fact.value.clone()), expected);
        }
    }
}

#[test]
fn more_energy_is_more_strain_and_a_thicker_wall_less() {
    let size = |values: Vec<f64>| values.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    let base = size(values("mercury_target_bubbles", &[]));
    assert!(size(values("mercury_target_bubbles", &[("pulse_energy", 1.3)])) > base);
    assert!(size(values("mercury_target_bubbles", &[("wall_thickness", 1.3)])) < base);
}

#[test]
fn values_without_meaning_are_refused_by_name() {
    let refused = |name: &str, value: f64| {
        respond("mercury_target_equilibrium_gas", &[(name, value)]).unwrap_err().to_string()
    };
    assert_eq!(
        refused("ambient_pressure", 10.0),
        "`ambient_pressure` is 10; it must be from 1000 to 100000000 Pa"
    );
    assert_eq!(refused("void_fraction", 0.5), "`void_fraction` is 0.5; it must be from 0 to 0.05");
    assert!(refused("bubble_radius", f64::NAN).starts_with("`bubble_radius` is NaN"));
    assert_eq!(refused("viscosity", 1.0), "the model has no input `viscosity`");
}
