//! Overhead of calling a user's model: `cargo run --release -p lacuna-bench --bin models`.
//!
//! Models of negligible cost are called many times, one call after another. Prints the median wall time per run: these
//! models wait for other processes, whose time is part of the cost. Quote it together with the load of the machine.

use std::error::Error;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use lacuna::data::{Axis, Function, Interpolation, Layout, Scenario, Unit};
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
    equations()?;
    Ok(std::fs::remove_dir_all(&study)?)
}

/// Cost of `equations`: values, and values with the derivatives by three inputs.
fn equations() -> Result<(), Box<dyn Error>> {
    let free = "state = { x = 1.0, v = 0.0 }\nobserve = 'x'\n\
                rate = { x = 'v', v = '(-a * v - b * x) / c' }";
    let forced = "state = { x = 0.0, v = 0.0 }\nobserve = 'x'\n\
                  rate = { x = 'v', v = '(force(time) - a * v - b * x) / c' }";
    let stiff = format!("{free}\nsolver = {{ method = 'bdf' }}");
    for (what, options, points, last, table) in [
        ("a line, 31 points, no states", "observe = 'a * time + b + c'", 31, 9.0, 0),
        ("oscillator, 1000 points, 9 periods", free, 1000, 9.0, 0),
        ("the same by `bdf`", &stiff, 1000, 9.0, 0),
        ("oscillator, 100 000 points, 900 periods", free, 100_000, 900.0, 0),
        ("oscillator, 100 000 points, 9 periods", free, 100_000, 9.0, 0),
        ("forced by a table of 100 000, 100 000 points", forced, 100_000, 900.0, 100_000),
    ] {
        let model = registry::from_text::<dyn Model>("equations", options)?.plugin;
        let [values, both] = derive(&*model, points, last, table)?;
        println!(
            "equations: {what}: {:.1} microseconds, with derivatives {:.1}",
            1e6 * values,
            1e6 * both
        );
    }
    Ok(())
}

/// Median times of a run for the response, and for the response with its derivatives, in seconds.
fn derive(
    model: &dyn Model,
    points: u32,
    last: f64,
    table: u32,
) -> Result<[f64; 2], Box<dyn Error>> {
    let grid = |count: u32, last: f64| -> Vec<f64> {
        (1..=count).map(|i| last * f64::from(i) / f64::from(count)).collect()
    };
    let unit = Unit::dimensionless;
    let axes = vec![Axis::grid("time", grid(points, last), unit())];
    let layout = Layout { name: "y".to_owned(), unit: unit(), axes };
    let mut scenario = Scenario::default();
    if table > 0 {
        let at: Vec<f64> = std::iter::once(0.0).chain(grid(table, last)).collect();
        let values = at.iter().map(|t| (0.7 * t).sin() + 0.3 * (5.3 * t).sin()).collect();
        let (at_unit, unit) = (unit(), unit());
        let force = Function {
            name: "force".to_owned(),
            at,
            at_unit,
            values,
            unit,
            interpolation: Interpolation::Linear,
        };
        scenario.functions.push(Arc::new(force));
    }
    let names = ["a", "b", "c"].map(str::to_owned);
    let inputs = [0.05, 39.478, 1.0];
    let call = Call::new(&inputs, &names, &layout, &scenario);
    let gradient = model.gradient().ok_or("equations have derivatives")?;
    let calls = (2_000_000 / (points + 1000)).clamp(5, 1000);
    let median = |ask: &dyn Fn() -> Result<(), Box<dyn Error>>| -> Result<f64, Box<dyn Error>> {
        let mut seconds = Vec::new();
        for _ in 0..=calls {
            let begun = Instant::now();
            ask()?;
            seconds.push(begun.elapsed().as_secs_f64());
        }
        seconds.sort_by(f64::total_cmp);
        Ok(seconds[seconds.len() / 2])
    };
    let values = median(&|| Ok(model.predict(&call).map(|_| ())?))?;
    let both = median(&|| match gradient.with_response(&call) {
        Some(both) => Ok(both.map(|_| ())?),
        None => Ok(gradient.jacobian(&call).map(|_| ())?),
    })?;
    Ok([values, both])
}

/// Median time of a run, in seconds.
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
    // The first call starts the processes that the others use.
    seconds.remove(0);
    seconds.sort_by(f64::total_cmp);
    Ok(seconds[seconds.len() / 2])
}
