//! Command `work`: started by executors on other machines.

use std::path::PathBuf;

use lacuna_engine::work::with_model;
use lacuna_run::work::{Assignment, Limits, work};

/// Assignment of a worker.
#[derive(clap::Args)]
pub struct Work {
    /// Folder of the order
    order: PathBuf,
    /// Index of the task in the order (default: runs are named on standard input)
    #[arg(long, value_name = "K")]
    task: Option<usize>,
    /// Number of runs of the task made in parallel
    #[arg(long, value_name = "N", default_value = "1")]
    parallel: std::num::NonZeroUsize,
    /// Use only one part of the processors, such as `0/4`, the first of four
    #[arg(long, value_name = "K/N", value_parser = part)]
    part: Option<(usize, usize)>,
    /// Memory that may be allocated, in bytes
    #[arg(long, value_name = "BYTES")]
    memory: Option<u64>,
}

fn part(text: &str) -> Result<(usize, usize), String> {
    let numbers = text.split_once('/').and_then(|(k, n)| Some((k.parse().ok()?, n.parse().ok()?)));
    numbers.filter(|(k, n)| k < n).ok_or_else(|| "expected a part such as `0/4`".to_owned())
}

/// Runs `lacuna work ORDER`.
pub fn run(asked: &Work) -> anyhow::Result<()> {
    let assignment = Assignment {
        order: asked.order.clone(),
        task: asked.task,
        parallel: asked.parallel.get(),
        limits: Limits { part: asked.part, memory: asked.memory },
    };
    let mut input = std::io::BufReader::new(std::io::stdin());
    Ok(work(&assignment, &with_model, &mut input, &mut std::io::stdout())?)
}
