//! `work`: what executors start on other machines.

use std::path::PathBuf;

use lacuna::work::{Assignment, Limits, work};

use crate::Failure;

/// What a worker is to do.
#[derive(clap::Args)]
pub struct Work {
    /// The folder of the order.
    order: PathBuf,
    /// The task of the order; runs are named on standard input when left out.
    #[arg(long, value_name = "K")]
    task: Option<usize>,
    /// How many runs of the task are made at a time.
    #[arg(long, value_name = "N", default_value = "1")]
    parallel: std::num::NonZeroUsize,
    /// Keep to one part of the processors, such as `0/4`, the first of four.
    #[arg(long, value_name = "K/N", value_parser = part)]
    part: Option<(usize, usize)>,
    /// The memory that may be allocated, in bytes.
    #[arg(long, value_name = "BYTES")]
    memory: Option<u64>,
}

fn part(text: &str) -> Result<(usize, usize), String> {
    let numbers = text.split_once('/').and_then(|(k, n)| Some((k.parse().ok()?, n.parse().ok()?)));
    numbers.filter(|(k, n)| k < n).ok_or_else(|| "expected a part such as `0/4`".to_owned())
}

/// `lacuna work ORDER`
pub fn run(asked: &Work) -> Result<(), Failure> {
    let assignment = Assignment {
        order: asked.order.clone(),
        task: asked.task,
        parallel: asked.parallel.get(),
        limits: Limits { part: asked.part, memory: asked.memory },
    };
    Ok(work(&assignment, &mut std::io::stdin().lock(), &mut std::io::stdout())?)
}
