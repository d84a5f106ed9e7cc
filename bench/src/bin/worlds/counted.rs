//! Cases drawn at random, each as a line of values for the count of right names.

use std::error::Error;

use generator::Kind;
use generator::noise::Source;
use generator::world::{Secret, World};

use crate::{Cases, Workflow};

/// The kinds of faults that are drawn.
const FAULTS: [Kind; 14] = [
    Kind::Gain,
    Kind::Offset,
    Kind::Drift,
    Kind::Delay,
    Kind::LowPass,
    Kind::Echo,
    Kind::Damping,
    Kind::Saturation,
    Kind::SecondaryPulse,
    Kind::Flash,
    Kind::PulseHeating,
    Kind::LevelJump,
    Kind::Resonance,
    Kind::Crosstalk,
];

/// The numbers of replicates that are drawn.
const REPLICATES: [usize; 4] = [6, 8, 12, 20];

/// The range of sizes in units of the noise.
const SIZES: [f64; 2] = [0.25, 2.5];

/// Draws so many cases and prints a line for each.
pub fn count<W: Workflow>(
    workflow: &W,
    cases: &Cases<'_>,
    count: usize,
) -> Result<(), Box<dyn Error>> {
    let is_drawn = |i: &u64| cases.only.is_none_or(|only| only.contains(&(*i as usize)));
    for i in (0..count as u64).filter(is_drawn) {
        let seed = 1_000_000 + 10_000 * cases.seed + i;
        let mut random = Source::new(seed);
        let mut secrets = drawn(workflow.world(), &mut random);
        if cases.nothing {
            secrets.clear();
        }
        if cases.inside {
            let changes = workflow.world().changes().len() as u64;
            secrets = vec![Secret::Inside((i % changes) as usize)];
        }
        let replicates = REPLICATES[(random.uniform(0.0, 1.0) * 4.0) as usize];
        let ratio = SIZES[0] * (SIZES[1] / SIZES[0]).powf(random.uniform(0.0, 1.0));
        let told = workflow.ask(seed, &secrets, ratio, replicates)?;
        if cases.only.is_some() {
            println!("{}", told.said);
        }
        println!("{}\t{seed}\t{replicates}\t{}", workflow.name(), told.values);
    }
    Ok(())
}

/// In five cases of twenty nothing but two faults, in nine one fault, in six physics inside the simulator.
fn drawn<W: World>(world: &W, random: &mut Source) -> Vec<Secret> {
    let all = world.sensors().len();
    let mut fault = || {
        let kind = FAULTS[(random.uniform(0.0, 1.0) * FAULTS.len() as f64) as usize];
        let most = if kind == Kind::Crosstalk { 1.0 } else { 3.0 };
        let count = 1 + (random.uniform(0.0, 1.0).powi(2) * most) as usize;
        let first = (random.uniform(0.0, 1.0) * all as f64) as usize;
        let step = 1 + (random.uniform(0.0, 1.0) * (all - 1) as f64) as usize;
        let mut sensors: Vec<usize> = (0..count).map(|k| (first + k * step) % all).collect();
        sensors.sort_unstable();
        sensors.dedup();
        Secret::Fault(kind, sensors)
    };
    let (one, two) = (fault(), fault());
    let inside = (random.uniform(0.0, 1.0) * world.changes().len() as f64) as usize;
    match (random.uniform(0.0, 1.0) * 20.0) as usize {
        0..9 => vec![one],
        9..12 => vec![one, two],
        12..14 => vec![one, Secret::Inside(inside)],
        _ => vec![Secret::Inside(inside)],
    }
}
