//! Verdicts of the gap workflow on single records: `nice cargo run --release -p lacuna-bench --bin records -- --seed N
//! --count M`, with `--from K` for the first case, `--only 3,4` for some cases, and `--say` for the candidates and the reasons.
//!
//! Records come from `tests/generator`, which shares no code with the engine. Each case is a study of one record as a
//! user would write it, with the noise of the instrument stated in every second case, and runs as `lacuna gap` does. A
//! line of tab-separated values is printed for each case, and a table of rates with their intervals at the end.

mod case;
mod studies;
mod tally;

use std::error::Error;

use generator::single;
use lacuna_plugins as _;

use crate::case::{HEADER, ask};
use crate::tally::Tally;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let after = |name: &str| {
        let at = arguments.iter().position(|a| a == name)?;
        arguments.get(at + 1).cloned()
    };
    let number =
        |name: &str, default: usize| after(name).map_or(Ok(default), |text| text.parse::<usize>());
    let (seed, from) = (number("--seed", 1)?, number("--from", 0)?);
    let count = number("--count", 3 * single::kinds())?;
    let only: Option<Vec<usize>> =
        after("--only").map(|text| text.split(',').filter_map(|n| n.parse().ok()).collect());
    let cases = only.unwrap_or_else(|| (from..from + count).collect());
    let say = arguments.iter().any(|a| a == "--say");
    println!("{HEADER}");
    let mut tally = Tally::default();
    for index in cases {
        let answer = ask(seed as u64, index)?;
        println!("{}", answer.line());
        if say {
            answer.leaders.iter().for_each(|step| println!("    * {step}"));
            answer.reasons.iter().for_each(|reason| println!("    - {reason}"));
        }
        tally.add(&answer);
    }
    println!("\n{}", tally.table());
    Ok(())
}
