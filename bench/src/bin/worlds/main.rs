//! Verdicts of the gap workflow in worlds whose physics has no form in the library: `cargo run --release -p lacuna-bench
//! --bin worlds -- box` (or `pipe`), with `--seed N`, `--only 3,4`, and `--scale 0.5`, a factor of all sizes.
//!
//! With `--random N` so many cases are drawn instead, and a line of tab-separated values is printed for each; with
//! `--nothing` nothing is hidden in them.
//!
//! Simulators and data come from `tests/generator`, which shares no code with the engine. Each case is printed with what
//! is hidden and what is said.

mod counted;
mod emulated;

use std::error::Error;

use generator::Kind;
use generator::mercury_box::MercuryBox;
use generator::pipe::Pipe;
use generator::world::{Secret, World};
use lacuna_plugins as _;

use crate::emulated::Emulated;

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
    if let Some(cases) = after("--random").and_then(|n| n.parse().ok()) {
        let nothing = arguments.iter().any(|a| a == "--nothing");
        let only = only.as_deref();
        return if arguments.first().is_some_and(|world| world == "pipe") {
            counted::count(&Emulated::new(Pipe, 250, 8)?, "pipe", seed, cases, nothing, only)
        } else {
            let world = Emulated::new(MercuryBox, 400, 16)?;
            counted::count(&world, "box", seed, cases, nothing, only)
        };
    }
    match arguments.first().map(String::as_str) {
        Some("pipe") => {
            run(&Emulated::new(Pipe, 250, 8)?, &in_the_pipe(), 8, seed, scale, only.as_deref())
        }
        _ => run(
            &Emulated::new(MercuryBox, 400, 16)?,
            &in_the_box(),
            12,
            seed,
            scale,
            only.as_deref(),
        ),
    }
}

fn run<W: World>(
    emulated: &Emulated<W>,
    cases: &[Case],
    replicates: usize,
    seed: u64,
    scale: f64,
    only: Option<&[usize]>,
) -> Result<(), Box<dyn Error>> {
    for (i, (secrets, ratio)) in cases.iter().enumerate() {
        if only.is_some_and(|only| !only.contains(&i)) {
            continue;
        }
        let answer = emulated.ask(1000 * seed + i as u64, secrets, scale * ratio, replicates)?;
        println!("{i} {}", answer.said(&emulated.world, scale * ratio));
    }
    Ok(())
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
