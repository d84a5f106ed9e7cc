//! All executors; those of a scheduler if one can be started.

use lacuna::plugin::Executor;

use super::{Table, all, slurm};

#[test]
fn every_executor() {
    let table: &Table = &[
        // Tested where its server is started: `campaign/queue.rs`.
        ("hyperqueue", &[]),
        (
            "local",
            &[
                "",
                "threads = 1",
                concat!("processes = 2\nprogram = '", env!("CARGO_BIN_EXE_contract_worker"), "'"),
            ],
        ),
        (
            "slurm",
            &[concat!(
                "pack = 2\npoll = 1\npatience = 1\nprogram = '",
                env!("CARGO_BIN_EXE_contract_worker"),
                "'"
            )],
        ),
    ];
    // A scheduler is found through the environment, which is that of the process started below.
    let there_is_slurm = std::env::var_os("SLURM_CONF").is_some();
    all::<dyn Executor>(table, |case, plugin| match case.plugin {
        "slurm" if !there_is_slurm => Ok(()),
        _ => lacuna_contract::executor(&case.label, plugin, case.scratch),
    });
}

#[test]
fn those_of_a_scheduler() {
    let Some(slurm) = slurm::started(slurm::Kind::Plain) else { return };
    let mut inside = std::process::Command::new(std::env::current_exe().unwrap());
    inside.args(["--exact", "executors::every_executor"]).env("SLURM_CONF", slurm.conf());
    let output = inside.output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stdout));
    // No jobs are left behind after the model or the caller has failed.
    assert!(slurm.ask("squeue", &["-h", "-t", "all"]).contains("CD"), "no job was run");
}
