//! The workflow on whole studies of a world with a companion: the table of runs and the measurements as files, the verdict
//! as `lacuna gap` gives it.

use std::error::Error;
use std::fmt::Write as _;
use std::fs;
use std::path::PathBuf;
use std::time::Instant;

use generator::noise::Source;
use generator::world::{Measured, Secret, World, measured};
use lacuna::run::Silent;
use lacuna_bench::clock::timed;
use lacuna_engine::gap::result::GapResult;
use lacuna_engine::study::resolve::load_text;
use lacuna_run::RunDirectory;
use rayon::prelude::*;

use crate::emulated::{hidden, traits, words};
use crate::{Told, Workflow};

/// A world with a companion.
pub trait Accompanied: World {
    /// `[gap.companion]` of a study.
    fn companion(&self) -> String;

    /// The degree of the polynomial chaos expansion.
    fn degree(&self) -> usize;

    /// The units of the parameters.
    fn units(&self) -> Vec<&'static str> {
        vec!["1"; self.parameters().len()]
    }
}

/// A world with its table of runs, in a folder.
pub struct Studied<W> {
    world: W,
    name: &'static str,
    folder: PathBuf,
}

/// The answer to a case.
struct Answer {
    measured: Measured,
    result: GapResult,
    /// The time, s, and that of all processors together, s.
    seconds: [f64; 2],
}

impl<W: Accompanied> Studied<W> {
    /// The world with a table of so many runs, drawn uniformly over the ranges of its parameters.
    pub fn new(world: W, name: &'static str, runs: usize) -> Result<Self, Box<dyn Error>> {
        let folder = std::env::temp_dir().join(format!("lacuna-{name}-{}", std::process::id()));
        fs::create_dir_all(&folder)?;
        let mut random = Source::new(77);
        let mut draw = |[low, high]: [f64; 2]| random.uniform(low, high);
        let ranges: Vec<[f64; 2]> = world.parameters().iter().map(|p| p.1).collect();
        let points: Vec<Vec<f64>> =
            (0..runs).map(|_| ranges.iter().map(|range| draw(*range)).collect()).collect();
        let rows: Vec<Vec<f64>> = points.par_iter().map(|p| world.response(p)).collect();
        let names: Vec<&str> = world.parameters().iter().map(|p| p.0).collect();
        let mut table = format!("run,{}\n", names.join(","));
        for (run, point) in points.iter().enumerate() {
            let values: Vec<String> = point.iter().map(f64::to_string).collect();
            let _ = writeln!(table, "{run},{}", values.join(","));
        }
        fs::write(folder.join("runs.csv"), table)?;
        for condition in 0..world.conditions() {
            let mut text = "run,sensor,time,y\n".to_owned();
            for (run, row) in rows.iter().enumerate() {
                lines(&mut text, &world, run, &row[range(&world, condition)]);
            }
            fs::write(folder.join(format!("responses{}.csv", ending(&world, condition))), text)?;
        }
        Ok(Self { world, name, folder })
    }

    fn answer(
        &self,
        seed: u64,
        secrets: &[Secret],
        ratio: f64,
        replicates: usize,
    ) -> Result<Answer, Box<dyn Error>> {
        let measured = measured(&self.world, seed, secrets, ratio, replicates);
        for (condition, all) in measured.replicates.iter().enumerate() {
            let mut text = "replicate,sensor,time,y\n".to_owned();
            for (replicate, row) in all.iter().enumerate() {
                lines(&mut text, &self.world, replicate, row);
            }
            let ending = ending(&self.world, condition);
            fs::write(self.folder.join(format!("data{ending}.csv")), text)?;
        }
        let text = self.text(seed);
        let checked = load_text(&self.folder.join("study.toml"), &text, &[]);
        let complaints = checked.complaints();
        let study = checked.study.ok_or_else(|| format!("{complaints}\n{text}"))?;
        let out = self.folder.join("run");
        let mut run = RunDirectory::open(&out)?;
        let begun = Instant::now();
        let (findings, processors) =
            timed(|| lacuna_engine::pipeline::find_gap(&study, &mut run, &Silent))?;
        let (findings, wall) = (findings?, begun.elapsed().as_secs_f64());
        drop(run);
        fs::remove_dir_all(&out)?;
        let result = findings.gap.ok_or("the study has no gap")?.result;
        Ok(Answer { measured, result, seconds: [wall, processors] })
    }

    fn text(&self, seed: u64) -> String {
        let world = &self.world;
        let mut text = format!("[study]\ntitle = \"a world\"\nseed = {seed}\n");
        for ((name, [low, high], _), unit) in world.parameters().into_iter().zip(world.units()) {
            let _ = write!(
                text,
                "\n[[parameter]]\nname = \"{name}\"\nunit = \"{unit}\"\nprior = {{ uniform = [{low:?}, {high:?}] }}\n"
            );
        }
        if world.conditions() > 1 {
            text += "\n[[scenario]]\nname = \"first\"\n\n[[scenario]]\nname = \"second\"\n";
        }
        let times = world.times();
        let ending = if world.conditions() > 1 { "-{scenario}" } else { "" };
        let _ = write!(
            text,
            r#"
[response]
name = "y"

[response.axes]
sensor = {:?}
time = {{ first = {:?}, last = {:?}, count = {}, unit = "s" }}

[simulations]
use = "csv"
parameters = "runs.csv"
responses = "responses{ending}.csv"

[measurements]
use = "csv"
path = "data{ending}.csv"

[surrogate]
use = "polynomial_chaos"
degree = {{ max = {} }}

[discrepancy]
use = "gaussian"
variance = {{ half_normal = {:e} }}
emulator_error = true

[sampler]
use = "no_u_turn"
warm_up = 60
steps = 120
"#,
            world.sensors(),
            times[0],
            times[times.len() - 1],
            times.len(),
            world.degree(),
            (2.0 * world.noise()).powi(2),
        );
        text + &world.companion()
    }
}

impl<W: Accompanied> Workflow for Studied<W> {
    type World = W;

    fn world(&self) -> &W {
        &self.world
    }

    fn name(&self) -> &'static str {
        self.name
    }

    fn ask(
        &self,
        seed: u64,
        secrets: &[Secret],
        ratio: f64,
        replicates: usize,
    ) -> Result<Told, Box<dyn Error>> {
        let answer = self.answer(seed, secrets, ratio, replicates)?;
        let (said, values) = (answer.said(&self.world, ratio), answer.values(&self.world, ratio));
        Ok(Told { said, values })
    }
}

impl<W> Drop for Studied<W> {
    fn drop(&mut self) {
        // A folder that stays behind is no error of a measurement.
        let _ = fs::remove_dir_all(&self.folder);
    }
}

fn ending<W: World>(world: &W, condition: usize) -> &'static str {
    match (world.conditions(), condition) {
        (1, _) => "",
        (_, 0) => "-first",
        _ => "-second",
    }
}

fn range<W: World>(world: &W, condition: usize) -> std::ops::Range<usize> {
    let each = world.sensors().len() * world.samples();
    condition * each..(condition + 1) * each
}

/// The lines of a long table.
fn lines<W: World>(text: &mut String, world: &W, first: usize, values: &[f64]) {
    let times = world.times();
    for (sensor, curve) in world.sensors().iter().zip(values.chunks(times.len())) {
        for (time, y) in times.iter().zip(curve) {
            let _ = writeln!(text, "{first},{sensor},{time},{y}");
        }
    }
}

impl Answer {
    /// The case and its answer in lines.
    fn said<W: World>(&self, world: &W, ratio: f64) -> String {
        let verdict = &self.result.verdict;
        let mut text = format!(
            "rms {ratio} [{}] -> {:?} closed {:.2} p {:.2?} {:.1} s, {:.1} s of processors",
            hidden(world, &self.measured.hidden, true),
            verdict.word,
            verdict.closed,
            self.result.p[0],
            self.seconds[0],
            self.seconds[1]
        );
        for e in &verdict.effects {
            let _ = write!(text, "\n    {}", words(e));
        }
        if let Some(held) = self.result.held_out.first() {
            let all = &held.proof.all;
            let _ = write!(
                text,
                "\n    * held out: closed {:.2} ({:.2} to {:.2})",
                all.closed, all.lower, all.upper
            );
        }
        if let Some(companion) = &self.result.companion {
            let _ = write!(
                text,
                "\n    * companion: error {:.3}, of changes {:.3}, constants {:.3?}",
                companion.error, companion.of_changes, companion.constants
            );
        }
        for step in &self.result.path {
            let ahead = step.leaders.iter().take(5).map(|leader| {
                let on: Vec<String> = leader.on.values().map(|labels| labels.join("+")).collect();
                format!("{}@{} {:.0}", leader.kind, on.join(" "), leader.log_weight)
            });
            let _ = write!(text, "\n    * {}", ahead.collect::<Vec<_>>().join(", "));
        }
        for reason in &verdict.reasons {
            let _ = write!(text, "\n    - {reason}");
        }
        text
    }

    /// The case and its answer as values that are separated by tabs: what is hidden, its size, the verdict, the share that
    /// is closed, the share closed on held-out data with its interval, the times, then each effect.
    fn values<W: World>(&self, world: &W, ratio: f64) -> String {
        let verdict = &self.result.verdict;
        let proof = self.result.held_out.first().map(|held| &held.proof.all);
        let [closed, lower, upper] =
            proof.map_or([f64::NAN; 3], |all| [all.closed, all.lower, all.upper]);
        let mut text = format!(
            "{}\t{ratio:.3}\t{:?}\t{:.3}\t{closed:.3} {lower:.3} {upper:.3}\t{:.1}",
            hidden(world, &self.measured.hidden, false),
            verdict.word,
            verdict.closed,
            self.seconds[0]
        );
        verdict.effects.iter().for_each(|effect| text += &traits(effect));
        text
    }
}
