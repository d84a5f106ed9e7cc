//! A small solver with its own command line, driven like Sierra: `vessel DECK` reads an input deck and writes an Exodus
//! II history file. The study `configs/external` calibrates it through a template of the deck.
//!
//! The mechanics are those of the stand-in `mercury_target`. A deck has blocks (`begin … end`) of lines `name = value`;
//! `$` and `#` begin comments. The exit code is 0 on success, 1 if the simulation failed, 2 if the deck is wrong.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::ExitCode;

use lacuna_plugins::models::mercury_target::{
    Cells, Mercury, Outcome, Sampling, Settings, simulate,
};
use lacuna_plugins::readers::sierra::write::{History, Origin, write_history};

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [deck] = &arguments[..] else {
        eprintln!("usage: vessel DECK");
        return ExitCode::from(2);
    };
    match run(Path::new(deck)) {
        Ok(()) => {
            println!("normal termination");
            ExitCode::SUCCESS
        }
        Err(Failure { text, code }) => {
            eprintln!("ERROR: {text}");
            ExitCode::from(code)
        }
    }
}

/// Error message and exit code of a failure.
struct Failure {
    text: String,
    code: u8,
}

fn wrong(text: String) -> Failure {
    Failure { text, code: 2 }
}

fn run(path: &Path) -> Result<(), Failure> {
    let text = std::fs::read_to_string(path)
        .map_err(|error| wrong(format!("{}: {error}", path.display())))?;
    let deck = Deck::parse(&text).map_err(|error| wrong(format!("{}:{error}", path.display())))?;
    let mercury = Mercury {
        density: deck.number("material mercury", "density")?,
        sound_speed: deck.number("material mercury", "sound speed")?,
        tensile_cutoff: deck.number("material mercury", "tensile cutoff")?,
    };
    let interval = deck.number("history output", "interval")?;
    let end = deck.number("history output", "termination time")?;
    let mut settings = Settings::default();
    let cells = deck.words("finite element model", "cells")?;
    settings.numerics.mesh = match cells.split_whitespace().map(str::parse).collect::<Vec<_>>()[..]
    {
        [Ok(across), Ok(along)] => Cells::Explicit([across, along]),
        _ => return Err(wrong(format!("`cells` is `{cells}`, expected two numbers"))),
    };
    settings.sampling = Sampling { interval, count: (end / interval).round() as usize };
    let outcome = simulate(&settings, &mercury)
        .map_err(|error| Failure { text: error.to_string(), code: 1 })?;
    let database = deck.words("history output", "database name")?;
    write(&path.with_file_name(database), &text, &settings, outcome)
        .map_err(|text| Failure { text, code: 1 })
}

/// Writes the strains in microstrain, the unit of the deck.
fn write(path: &Path, deck: &str, settings: &Settings, outcome: Outcome) -> Result<(), String> {
    let names = settings.gauges.0.iter().map(|gauge| format!("strain_{}", gauge.name)).collect();
    let micro = |strains: &Vec<f64>| strains.iter().map(|strain| 1e6 * strain).collect();
    let values = outcome.strain.iter().map(micro).collect();
    let history = History { times: outcome.times, names, values };
    let origin = Origin {
        title: "strain of a mercury target".to_owned(),
        qa: ["vessel", "1.0", "1970/01/01", "00:00:00"].map(str::to_owned),
        info: deck.lines().map(str::to_owned).collect(),
    };
    write_history(path, &origin, &history).map_err(|stop| stop.to_string())
}

/// The values of a deck by block and name.
struct Deck(BTreeMap<(String, String), String>);

impl Deck {
    fn parse(text: &str) -> Result<Self, String> {
        let mut values = BTreeMap::new();
        let mut blocks: Vec<&str> = Vec::new();
        for (i, line) in text.lines().enumerate() {
            let at = |what: &str| format!("{}: {what}", i + 1);
            let line = line.split(['$', '#']).next().unwrap_or("").trim();
            if line.is_empty() {
            } else if let Some(name) = line.strip_prefix("begin ") {
                blocks.push(name.trim());
            } else if line == "end" || line.starts_with("end ") {
                let open = blocks.pop().ok_or_else(|| at("`end` without `begin`"))?;
                let name = line["end".len()..].trim();
                if !name.is_empty() && name != open {
                    return Err(at(&format!("expected `end {open}`, found `{line}`")));
                }
            } else {
                let (name, value) = line
                    .split_once('=')
                    .ok_or_else(|| at(&format!("expected `name = value`, found `{line}`")))?;
                let block = blocks.last().copied().unwrap_or("");
                let key = (block.to_owned(), name.trim().to_owned());
                if values.insert(key, value.trim().to_owned()).is_some() {
                    return Err(at(&format!("a second `{}`", name.trim())));
                }
            }
        }
        match blocks.pop() {
            Some(open) => Err(format!("{}: `begin {open}` has no `end`", text.lines().count())),
            None => Ok(Self(values)),
        }
    }

    fn words(&self, block: &str, name: &str) -> Result<&str, Failure> {
        let value = self.0.get(&(block.to_owned(), name.to_owned()));
        value
            .map(String::as_str)
            .ok_or_else(|| wrong(format!("the block `{block}` has no `{name}`")))
    }

    fn number(&self, block: &str, name: &str) -> Result<f64, Failure> {
        let text = self.words(block, name)?;
        let number = text.parse::<f64>().ok().filter(|x| x.is_finite());
        number.ok_or_else(|| wrong(format!("`{name}` is `{text}`, expected a number")))
    }
}
