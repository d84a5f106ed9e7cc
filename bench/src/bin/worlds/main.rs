//! Verdicts of the gap workflow in worlds whose physics has no form in the library: `cargo run --release -p lacuna-bench
//! --bin worlds -- box` (or `pipe`, `vessel`), with `--seed N`, `--only 3,4`, and `--scale 0.5`, a factor of all sizes.
//!
//! With `--companion` each case is a whole study with a companion, as `lacuna gap` runs it; those of the vessel always are.
//! `--inside` draws physics inside the simulator alone.
//!
//! With `--random N` so many cases are drawn instead, and a line of tab-separated values is printed for each; with
//! `--nothing` nothing is hidden in them.
//!
//! Simulators and data come from `tests/generator`, which shares no code with the engine. Each case is printed with what
//! is hidden and what is said.

mod companions;
mod counted;
mod emulated;
mod studied;
mod vessel;

use std::error::Error;

use generator::Kind;
use generator::mercury_box::MercuryBox;
use generator::pipe::Pipe;
use generator::world::{Secret, World};
use lacuna_plugins as _;

use crate::emulated::Emulated;
use crate::studied::Studied;
use crate::vessel::Vessel;

/// Hidden causes, and their size in units of the noise.
type Case = (Vec<Secret>, f64);

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let after = |name: &str| {
        let at = arguments.iter().position(|a| a == name)?;
        arguments.get(at + 1).cloned()
    };
    let seed = after("--seed").and_then(|n| n.parse().ok()).unwrap_or(1);
    let scale = after("--scale").and_then(|n| n.parse().ok()).unwrap_or(1.0);
    let only: Option<Vec<usize>> =
        after("--only").map(|text| text.split(',').filter_map(|n| n.parse().ok()).collect());
    let only = only.as_deref();
    let count = after("--random").and_then(|n| n.parse().ok());
    let nothing = arguments.iter().any(|a| a == "--nothing");
    let inside = arguments.iter().any(|a| a == "--inside");
    let cases = Cases { seed, scale, count, nothing, inside, only };
    let companion = arguments.iter().any(|a| a == "--companion");
    match (arguments.first().map(String::as_str), companion) {
        (Some("pipe"), true) => cases.ask(&Studied::new(Pipe, "pipe", 250)?, &in_the_pipe(), 8),
        (Some("pipe"), false) => {
            cases.ask(&Emulated::new(Pipe, "pipe", 250, 8)?, &in_the_pipe(), 8)
        }
        (Some("vessel"), _) => {
            cases.ask(&Studied::new(Vessel, "vessel", 200)?, &in_the_vessel(), 8)
        }
        (_, true) => cases.ask(&Studied::new(MercuryBox, "box", 400)?, &in_the_box(), 12),
        (_, false) => cases.ask(&Emulated::new(MercuryBox, "box", 400, 16)?, &in_the_box(), 12),
    }
}

/// The gap workflow on a world.
trait Workflow {
    /// The world.
    type World: World;

    fn world(&self) -> &Self::World;

    /// The name of the world in tables.
    fn name(&self) -> &'static str;

    /// Asks the workflow, which does not see what is hidden: `ratio` is the size of each cause in units of the noise.
    fn ask(
        &self,
        seed: u64,
        secrets: &[Secret],
        ratio: f64,
        replicates: usize,
    ) -> Result<Told, Box<dyn Error>>;
}

/// The answer to a case.
struct Told {
    /// In words.
    said: String,
    /// As values that are separated by tabs.
    values: String,
}

/// The cases that are asked.
struct Cases<'a> {
    seed: u64,
    /// A factor of all sizes of the fixed cases.
    scale: f64,
    /// The number of cases drawn at random; `None` for the fixed ones.
    count: Option<usize>,
    /// True if nothing is hidden in random cases.
    nothing: bool,
    /// True if only physics inside the simulator is hidden in random cases.
    inside: bool,
    /// The places of those that are asked; `None` for all.
    only: Option<&'a [usize]>,
}

impl Cases<'_> {
    fn ask<W: Workflow>(
        &self,
        workflow: &W,
        fixed: &[Case],
        replicates: usize,
    ) -> Result<(), Box<dyn Error>> {
        if let Some(count) = self.count {
            return counted::count(workflow, self, count);
        }
        for (i, (secrets, ratio)) in fixed.iter().enumerate() {
            if self.only.is_some_and(|only| !only.contains(&i)) {
                continue;
            }
            let seed = 1000 * self.seed + i as u64;
            let told = workflow.ask(seed, secrets, self.scale * ratio, replicates)?;
            println!("{i} {}", told.said);
        }
        Ok(())
    }
}

fn fault(kind: Kind, sensors: &[usize]) -> Vec<Secret> {
    vec![Secret::Fault(kind, sensors.to_vec())]
}

fn in_the_box() -> Vec<Case> {
    let inside = |i: usize| vec![Secret::Inside(i)];
    let mut both = inside(0);
    both.extend(fault(Kind::Gain, &[2]));
    vec![
        (vec![], 0.0),
        (vec![], 0.0),
        (fault(Kind::Gain, &[1, 6]), 1.4),
        (fault(Kind::Delay, &[0, 3, 8]), 1.0),
        (fault(Kind::Offset, &[4, 9]), 3.3),
        (fault(Kind::Crosstalk, &[5]), 1.2),
        (fault(Kind::Resonance, &[7]), 3.6),
        (fault(Kind::LowPass, &[2]), 1.7),
        (fault(Kind::Drift, &[0, 6]), 3.0),
        (fault(Kind::Saturation, &[1, 5]), 1.4),
        (inside(7), 0.9),
        (inside(0), 0.65),
        (inside(1), 0.55),
        (inside(2), 0.7),
        (both, 0.65),
        (inside(3), 0.7),
        (inside(4), 0.8),
        (inside(5), 0.7),
        (inside(6), 0.7),
    ]
}

fn in_the_vessel() -> Vec<Case> {
    (0..11).map(|i| (vec![Secret::Inside(i)], 1.0)).collect()
}

fn in_the_pipe() -> Vec<Case> {
    let mut cases = vec![
        (vec![], 0.0),
        (vec![], 0.0),
        (fault(Kind::Gain, &[0, 1]), 1.0),
        (fault(Kind::Delay, &[3]), 1.0),
        (fault(Kind::Offset, &[5]), 1.0),
        (fault(Kind::Crosstalk, &[2]), 1.0),
        (fault(Kind::Resonance, &[4]), 1.5),
        (fault(Kind::LowPass, &[2, 3, 4]), 1.0),
        (fault(Kind::Saturation, &[5]), 1.4),
        (fault(Kind::Drift, &[1]), 1.0),
    ];
    cases.extend((0..8).map(|i| (vec![Secret::Inside(i)], 1.0)));
    cases
}
