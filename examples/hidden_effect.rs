//! Makes the measured data of `configs/hidden_effect`: `cargo run --release -p lacuna-examples --bin hidden_effect`.
//!
//! A chain of two masses with an effect that its model lacks, integrated and modified at ten times the sampling rate by
//! code that shares nothing with the engine; twelve replicates with correlated noise under each condition.

use std::error::Error;
use std::fmt::Write as _;
use std::path::Path;

use generator::{Kind, SAMPLES, SENSORS, times};

const SEED: u64 = 1846;
const REPLICATES: usize = 12;
const HIDDEN: (Kind, usize) = (Kind::Saturation, 2);

fn main() -> Result<(), Box<dyn Error>> {
    let (kind, sensor) = HIDDEN;
    let case = generator::case(SEED, &[(kind, vec![sensor])], 1.0, REPLICATES);
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs/hidden_effect");
    for (scenario, replicates) in ["knock", "sweep"].iter().zip(&case.replicates) {
        let mut text = "replicate,sensor,time,y\n".to_owned();
        for (r, replicate) in replicates.iter().enumerate() {
            for (curve, sensor) in replicate.chunks(SAMPLES).zip(SENSORS) {
                for (time, y) in times().iter().zip(curve) {
                    writeln!(text, "{},{sensor},{time:.1},{y:.5}", r + 1)?;
                }
            }
        }
        std::fs::write(folder.join(format!("{scenario}.csv")), text)?;
    }
    println!("parameters {:?}", case.truth);
    for hidden in &case.hidden {
        println!("{hidden:?}");
    }
    Ok(())
}
