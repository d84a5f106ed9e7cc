//! A Slurm scheduler for tests; `start` beside this file has the steps.

use std::fs::{self, File};
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicU16, Ordering};

use tempfile::TempDir;

/// A running Slurm; ends when it is dropped.
pub struct Slurm {
    folder: TempDir,
}

/// Configuration of the scheduler.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    Plain,
    Accounting,
    /// Two nodes, memory limits, preemption.
    Nodes,
}

impl Kind {
    fn name(self) -> &'static str {
        match self {
            Self::Plain => "plain",
            Self::Accounting => "accounting",
            Self::Nodes => "nodes",
        }
    }
}

fn scripts() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("slurm")
}

/// Starts a scheduler if possible; `LACUNA_REQUIRE_SLURM=1` makes it a failure if not.
pub fn started(kind: Kind) -> Option<Slurm> {
    let folder = tempfile::tempdir().unwrap();
    let begun = missing(kind).map_or_else(|| start(folder.path(), kind), Err);
    let required = std::env::var_os("LACUNA_REQUIRE_SLURM").is_some_and(|value| value == "1");
    match begun {
        Ok(()) => Some(Slurm { folder }),
        Err(reason) if required => panic!("LACUNA_REQUIRE_SLURM is set, and {reason}"),
        Err(reason) => {
            println!("skipped: {reason}");
            None
        }
    }
}

/// Reason why it cannot be started here.
fn missing(kind: Kind) -> Option<String> {
    let root = Command::new("id").arg("-u").output().is_ok_and(|o| o.stdout == b"0\n");
    if !root {
        return Some("Slurm is started by root alone".to_owned());
    }
    let mut programs = vec!["slurmctld", "slurmd", "sbatch", "squeue", "munged"];
    if kind == Kind::Accounting {
        programs.extend(["slurmdbd", "sacct", "mariadbd", "mariadb-install-db"]);
    }
    if kind == Kind::Nodes {
        programs.push("srun");
    }
    let folders = ["/usr/sbin", "/usr/bin", "/usr/local/sbin", "/usr/local/bin", "/sbin", "/bin"];
    let is_there = |program: &&str| folders.iter().any(|f| Path::new(f).join(program).exists());
    let first = programs.into_iter().find(|program| !is_there(program))?;
    Some(format!("there is no `{first}`"))
}

fn start(folder: &Path, kind: Kind) -> Result<(), String> {
    let port = free_ports();
    let log = File::create(folder.join("start.log")).unwrap();
    let status = Command::new(scripts().join("start"))
        .arg(folder)
        .args([kind.name(), &port.to_string()])
        .stdin(Stdio::null())
        .stdout(log.try_clone().unwrap())
        .stderr(log)
        .status();
    let said = fs::read_to_string(folder.join("start.log")).unwrap_or_default();
    match status {
        Ok(status) if status.success() => Ok(()),
        _ => {
            stop(folder);
            Err(format!("Slurm does not start: {}", said.trim()))
        }
    }
}

/// The first of four free ports. Tests of one process that call this at the same time get different ones.
fn free_ports() -> u16 {
    static ASKED: AtomicU16 = AtomicU16::new(0);
    let own = 20_000 + (std::process::id() % 500) as u16 * 40;
    let first = own + 4 * ASKED.fetch_add(1, Ordering::Relaxed);
    let is_free = |port: &u16| (0..4).all(|i| TcpListener::bind(("127.0.0.1", port + i)).is_ok());
    (first..60_000).step_by(4).find(is_free).unwrap()
}

fn stop(folder: &Path) {
    let _ = Command::new(scripts().join("stop")).arg(folder).status();
}

impl Slurm {
    /// Path of its configuration file, for the variable `SLURM_CONF`.
    pub fn conf(&self) -> PathBuf {
        self.folder.path().join("slurm.conf")
    }

    /// Output of one of its commands.
    pub fn ask(&self, program: &str, arguments: &[&str]) -> String {
        let output =
            Command::new(program).args(arguments).env("SLURM_CONF", self.conf()).output().unwrap();
        String::from_utf8(output.stdout).unwrap()
    }
}

impl Drop for Slurm {
    fn drop(&mut self) {
        stop(self.folder.path());
    }
}
