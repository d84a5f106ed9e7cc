//! Overhead of a discrepancy and a sampler in a library:
//! `cargo run --release -p lacuna-bench --bin dynamic [-- REPEATS]`.
//!
//! The calibration of the founding study (MAP search and 144,000 evaluations), with the built-in `gaussian` and
//! `affine_invariant_ensemble` and with the same code in a loaded library, alternately. Prints one line of JSON: the
//! medians of the processor seconds, their ratio, and the quartiles of the ratios of neighbouring runs.

use std::error::Error;
use std::fs;
use std::path::{Path, PathBuf};

use lacuna::run::Silent;
use lacuna_bench::clock::timed;
use lacuna_engine::host::library;
use lacuna_engine::pipeline::calibrate_emulated;
use lacuna_engine::stage::calibrate;
use lacuna_engine::stage::emulated::Emulated;
use lacuna_engine::study::{Study, resolve};
use lacuna_run::{RunDirectory, Stage};
// Without these lines the linker leaves the plugins out, and cargo the library.
use lacuna_plugins as _;
use lacuna_twin as _;
use serde_json::json;

type Fallible<T> = Result<T, Box<dyn Error>>;

/// A study with its fitted emulator.
struct Side {
    study: Study,
    run: RunDirectory,
    learned: Emulated,
}

fn main() -> Fallible<()> {
    let repeats: usize = std::env::args().nth(1).map_or(Ok(15), |text| text.parse())?;
    library::load(&twin()?, None)?;
    let folder = Path::new("runs/bench-dynamic");
    let twins = ["discrepancy.use=twin_gaussian", "discrepancy.variance={ half_normal = 1e-6 }"];
    let walkers =
        ["sampler.use=twin_affine_invariant_ensemble", "sampler.walkers=120", "sampler.steps=1200"];
    let mut own = side(&[], &folder.join("own"))?;
    let mut loaded = side(&[&twins[..], &walkers[..]].concat(), &folder.join("loaded"))?;
    let (mut pairs, mut bits) = (Vec::new(), Vec::new());
    for i in 0..repeats {
        // Each variant goes first every other time.
        let first = calibrated(if i % 2 == 0 { &mut own } else { &mut loaded }, i)?;
        let second = calibrated(if i % 2 == 0 { &mut loaded } else { &mut own }, i)?;
        let (a, b) = if i % 2 == 0 { (first, second) } else { (second, first) };
        bits.push(a.1 == b.1);
        pairs.push((a.0, b.0));
    }
    let of = |pick: fn(&(f64, f64)) -> f64| sorted(pairs.iter().map(pick).collect());
    let (a, b, ratios) = (of(|p| p.0), of(|p| p.1), of(|p| p.1 / p.0));
    let line = json!({
        "repeats": repeats, "same_bits": bits.iter().all(|same| *same),
        "built_in_cpu_seconds": a[repeats / 2], "loaded_cpu_seconds": b[repeats / 2],
        "ratio_of_medians": b[repeats / 2] / a[repeats / 2], "ratio_of_least": b[0] / a[0],
        "ratio_quartiles": [ratios[repeats / 4], ratios[repeats / 2], ratios[3 * repeats / 4]],
    });
    println!("{line}");
    Ok(())
}

fn sorted(mut values: Vec<f64>) -> Vec<f64> {
    values.sort_by(f64::total_cmp);
    values
}

/// Path of the library, which was built together with this program.
fn twin() -> Fallible<PathBuf> {
    let program = std::env::current_exe()?;
    let name =
        format!("{}lacuna_twin{}", std::env::consts::DLL_PREFIX, std::env::consts::DLL_SUFFIX);
    Ok(program.with_file_name("deps").join(name))
}

fn side(settings: &[&str], out: &Path) -> Fallible<Side> {
    let settings: Vec<String> = settings.iter().map(ToString::to_string).collect();
    let checked = resolve::load(Path::new("configs/sns/study.toml"), &settings);
    let complaints = checked.complaints();
    let study = checked.study.ok_or(complaints)?;
    let mut run = RunDirectory::open(out)?;
    let (learned, _) = calibrate_emulated(&study, &mut run, &Silent)?;
    Ok(Side { study, run, learned })
}

/// Processor seconds of one calibration, and the hash of its draws.
fn calibrated(side: &mut Side, repeat: usize) -> Fallible<(f64, String)> {
    let Side { study, run, learned } = side;
    let folder = Stage::Calibrate.part(&repeat.to_string());
    let (made, seconds) =
        timed(|| calibrate::stage(study, &learned.problem(), &folder, run, &Silent))?;
    made?;
    let folder = run.stage_folder(&folder);
    let hash = lacuna::run::files::hash_file(&folder.join("draws.nc"))?;
    // A kept result would be reused the next time.
    fs::remove_dir_all(&folder)?;
    Ok((seconds, hash))
}
