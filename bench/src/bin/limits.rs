//! The founding study compared with its limits: `cargo run --release -p lacuna-bench --bin limits [-- STUDY]`.
//!
//! Runs the built `lacuna` on a study twice in a temporary folder, from scratch and with its simulations kept, and
//! prints wall time, peak memory and the time of every stage beside the limit, with the load of the machine.

use std::error::Error;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;

fn main() -> Result<(), Box<dyn Error>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let study =
        std::env::args().nth(1).map_or_else(|| root.join("configs/sns/study.toml"), PathBuf::from);
    let lacuna = std::env::current_exe()?.with_file_name("lacuna");
    if !lacuna.exists() {
        return Err("build it first: cargo build --release -p lacuna-cli".into());
    }
    let out = std::env::temp_dir().join(format!("lacuna-limits-{}", std::process::id()));
    let cores = std::thread::available_parallelism()?;
    println!("{} on {cores} cores, load before {}", study.display(), load());
    let (seconds, memory) = run(&lacuna, &study, &out)?;
    row("whole study", seconds, "s", 480.0);
    row("peak memory", memory, "MiB", 1024.0);
    let manifest: Value = serde_json::from_slice(&fs::read(out.join("manifest.json"))?)?;
    for stage in manifest["stages"].as_array().into_iter().flatten() {
        let name = stage["stage"].as_str().unwrap_or_default();
        let seconds = stage["seconds"].as_f64().unwrap_or_default();
        let limit = if name == "4-surrogate" { 60.0 } else { f64::INFINITY };
        row(name, seconds, "s", limit);
    }
    for stage in ["3-read", "4-surrogate", "5-calibrate", "6-validate", "8-report"] {
        fs::remove_dir_all(out.join(stage))?;
    }
    let (seconds, _) = run(&lacuna, &study, &out)?;
    row("with simulations kept", seconds, "s", 30.0);
    println!("load after {}", load());
    fs::remove_dir_all(out)?;
    Ok(())
}

fn row(what: &str, value: f64, unit: &str, limit: f64) {
    let verdict = match (limit.is_finite(), value <= limit) {
        (false, _) => String::new(),
        (true, true) => format!("limit {limit} {unit}: met"),
        (true, false) => format!("limit {limit} {unit}: NOT met"),
    };
    println!("{what:<24} {value:>9.2} {unit:<4} {verdict}");
}

/// Runs a study; returns its wall time in seconds and its peak resident memory in MiB.
fn run(lacuna: &Path, study: &Path, out: &Path) -> Result<(f64, f64), Box<dyn Error>> {
    let begun = Instant::now();
    let mut command = Command::new(lacuna);
    command.arg("run").arg(study).arg("--out").arg(out);
    let mut child = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn()?;
    let mut memory = 0.0_f64;
    let status = loop {
        memory = memory.max(resident(&child));
        if let Some(status) = child.try_wait()? {
            break status;
        }
        std::thread::sleep(Duration::from_millis(20));
    };
    if !status.success() {
        return Err(format!("lacuna ended with {status}").into());
    }
    Ok((begun.elapsed().as_secs_f64(), memory))
}

/// Peak resident memory of a running process so far, in MiB, as reported by Linux.
fn resident(child: &Child) -> f64 {
    let status = fs::read_to_string(format!("/proc/{}/status", child.id())).unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    let kibibytes = line.and_then(|text| text.split_whitespace().next()?.parse::<f64>().ok());
    kibibytes.unwrap_or(0.0) / 1024.0
}

/// Load averages over 1, 5 and 15 minutes.
fn load() -> String {
    let text = fs::read_to_string("/proc/loadavg").unwrap_or_default();
    text.split_whitespace().take(3).collect::<Vec<_>>().join(" ")
}
