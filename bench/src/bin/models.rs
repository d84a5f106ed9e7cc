//! What it costs to ask a model of the user's own: `cargo run --release -p lacuna-bench --bin models`.
//!
//! Models that do next to nothing are asked many times, one call after another. Printed is the median wall time a
//! run: these models wait for other processes, whose time is part of the cost. Say the machine's load with it.

use std::error::Error;
use std::path::Path;
use std::time::Instant;

use lacuna::data::{Axis, Layout, Scenario, Unit};
use lacuna::plugin::model::Call;
use lacuna::plugin::{Model, registry};
use lacuna_plugins as _;

const PYTHON: &str = "
def simulate(a, b, layout):
    return [a * t + b for t in layout['axes'][0]['values']]

def rows(a, b, layout):
    times = layout['axes'][0]['values']
    return [[x * t + y for t in times] for x, y in zip(a, b)]
";

fn main() -> Result<(), Box<dyn Error>> {
    let study = std::env::temp_dir().join(format!("lacuna-models-{}", std::process::id()));
    std::fs::create_dir_all(&study)?;
    std::fs::write(study.join("model.py"), PYTHON)?;
    std::fs::write(study.join("table"), "time,y\n1,{{ a }}\n2,{{ b }}\n3,0\n")?;
    let table = "command = ['true']\noutput = { use = 'csv', path = 'y.csv' }\n\
                 templates = [{ from = 'table', to = 'y.csv' }]";
    let shell = "command = ['sh', '-c', 'echo [{{ a }}, {{ b }}, 0]']\noutput = 'json'";
    let python = "file = 'model.py'";
    let rows = "file = 'model.py'\nfunction = 'rows'\nvectorised = true";
    for (what, name, options, points, batch, calls) in [
        ("external: `true`, a template, a table", "external", table, 3, 1, 400),
        ("external: `sh -c echo`, JSON", "external", shell, 3, 1, 400),
        ("python, 3 values", "python", python, 3, 1, 4000),
        ("python, 1000 values", "python", python, 1000, 1, 1000),
        ("python, 3 values, batches of 100", "python", rows, 3, 100, 200),
        ("python, 1000 values, batches of 100", "python", rows, 1000, 100, 20),
    ] {
        let model = registry::from_text::<dyn Model>(name, options)?.plugin;
        let seconds = ask(&*model, &study, points, batch, calls)?;
        println!("{what}: {:.1} microseconds a run", 1e6 * seconds);
    }
    Ok(std::fs::remove_dir_all(&study)?)
}

/// The median time of a run, in seconds.
fn ask(
    model: &dyn Model,
    study: &Path,
    points: u32,
    batch: usize,
    calls: usize,
) -> Result<f64, Box<dyn Error>> {
    let times = (1..=points).map(f64::from).collect();
    let axes = vec![Axis::grid("time", times, Unit::parse("s")?)];
    let layout = Layout { name: "y".to_owned(), unit: Unit::dimensionless(), axes };
    let (names, scenario) = (["a", "b"].map(str::to_owned), Scenario::default());
    let inputs: Vec<[f64; 2]> = (0..batch).map(|i| [0.1 * i as f64, 0.5]).collect();
    let calls_of = |inputs| Call {
        inputs,
        names: &names,
        units: &[],
        layout: &layout,
        scenario: &scenario,
        study,
        directory: None,
    };
    let asked: Vec<Call<'_>> = inputs.iter().map(|inputs| calls_of(&inputs[..])).collect();
    let mut seconds = Vec::with_capacity(calls);
    for _ in 0..=calls {
        let begun = Instant::now();
        for answer in model.predict_batch(&asked) {
            answer?;
        }
        seconds.push(begun.elapsed().as_secs_f64() / batch as f64);
    }
    // The first call starts what the others use.
    seconds.remove(0);
    seconds.sort_by(f64::total_cmp);
    Ok(seconds[seconds.len() / 2])
}
