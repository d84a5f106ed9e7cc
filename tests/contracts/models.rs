//! All models, each with options of a small study.

use lacuna::data::{Axis, Layout, Parameter, Scenario, Unit};
use lacuna::math::distribution::Distribution;
use lacuna::plugin::{Context, Given, Model};

use super::{Table, all, served};

/// A response as a template of a table.
const TABLE: &str = "time,y\n1,{{ a }}\n2,{{ b | %.3e }}\n3,0\n4,0\n5,0\n";

/// A model as Python functions.
const MODEL: &str = "
def simulate(a, b):
    return [(a + 1) ** 2 * t + b * b for t in range(5)]

def slopes(a, b):
    return {'a': [2 * (a + 1) * t for t in range(5)], 'b': [2 * b] * 5}

def rows(a, b):
    return [simulate(x, y) for x, y in zip(a, b)]
";

/// Returns true if `python3` runs; `LACUNA_REQUIRE_PYTHON=1` makes its absence a failure.
fn there_is_python() -> bool {
    let there = std::process::Command::new("python3").arg("--version").output().is_ok();
    let required = std::env::var_os("LACUNA_REQUIRE_PYTHON").is_some_and(|value| value == "1");
    assert!(there || !required, "LACUNA_REQUIRE_PYTHON is set, and there is no `python3`");
    if !there {
        println!("skipped for the model `python`: there is no `python3`");
    }
    there
}

#[test]
fn models() {
    let composed = &["[[parts]]\nname = 'load'\nuse = 'equations'\nobserve = 'a + 2 * b'\n\
          gives = { name = 'force' }\n[[parts]]\nname = 'sensor'\nuse = 'equations'\n\
          observe = 'force * time / 1 {s} + a^2'"];
    let external = &[
        "command = ['sh', '-c', 'echo [{{ a }}, {{ b }}, 3, 4, 5]']\noutput = 'json'",
        "command = ['cp', 'table', 'y.csv']\ntemplates = [{ from = 'table', to = 'table' }]\n\
         output = { use = 'csv', path = 'y.csv' }\nretries = 1",
    ];
    let python = &[
        "file = 'model.py'\ngradient = 'slopes'",
        "file = 'model.py'\nfunction = 'rows'\nvectorised = true",
    ];
    let table: &Table = &[
        ("composed", composed),
        (
            "equations",
            &[
                "observe = \"a + sin(b * time / 1 {s}) + b\"",
                "state = { y = \"a + 1\" }\nrate = { y = \"(b - y^2) / 1 {s}\" }\nobserve = \"y\"",
            ],
        ),
        ("external", external),
        ("mercury_target", &["numerics = { mesh = [6, 24] }"]),
        ("mercury_target_bubbles", &["numerics = { mesh = [6, 24] }"]),
        ("mercury_target_equilibrium_gas", &["numerics = { mesh = [6, 24] }"]),
        ("python", if there_is_python() { python } else { &[] }),
        ("um_bridge", served::options()),
    ];
    let parameters =
        ["a", "b"].map(|name| Parameter::plain(name, Distribution::Uniform([0.0, 2.0])));
    let given =
        parameters.clone().map(|p| Given { name: p.name.clone(), unit: Some(p.unit.clone()) });
    let scenarios = [Scenario::default()];
    let grid = (1..=5).map(f64::from).collect();
    let axes = vec![Axis::grid("time", grid, Unit::parse("s").unwrap())];
    let layout = Layout { name: "y".to_owned(), unit: Unit::dimensionless(), axes };
    all::<dyn Model>(table, |case, model| {
        std::fs::write(case.scratch.join("table"), TABLE).unwrap();
        std::fs::write(case.scratch.join("model.py"), MODEL).unwrap();
        let context = Context {
            given: &given,
            scenarios: &scenarios,
            ..Context::new(case.scratch, &parameters, &layout)
        };
        lacuna_contract::model(&case.label, model, &context, case.scratch)
    });
}
