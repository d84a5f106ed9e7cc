//! The program that executors start in the tests of their contract; it contains the model of the suite.

use std::path::PathBuf;
use std::process::ExitCode;

use lacuna::plugin::Model;
use lacuna_contract::Line;
use lacuna_engine::work::with_model;
use lacuna_run::work::{Assignment, Limits, work};
// The other models.
use lacuna_plugins as _;

lacuna::register!(Model, "contract_line", Line);

/// Usage: `worker work ORDER [--task K] [--parallel N]`.
fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().collect();
    let after = |flag: &str| {
        let at = words.iter().position(|word| word == flag)?;
        words.get(at + 1)?.parse::<usize>().ok()
    };
    let Some(order) = words.get(2).map(PathBuf::from) else { return ExitCode::from(2) };
    let assignment = Assignment {
        order,
        task: after("--task"),
        parallel: after("--parallel").unwrap_or(1),
        limits: Limits::default(),
    };
    let mut input = std::io::BufReader::new(std::io::stdin());
    match work(&assignment, &with_model, &mut input, &mut std::io::stdout()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(stop) => {
            eprintln!("{stop}");
            ExitCode::FAILURE
        }
    }
}
