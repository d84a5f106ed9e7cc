//! Results that are kept, reused, moved aside and repeated.

use lacuna::run::Silent;

use super::*;
use crate::Stage;
use crate::testing::{Number, keep};

#[test]
fn a_stage_is_made_once_for_each_input_and_never_lost() {
    let folder = tempfile::tempdir().unwrap();
    let mut run = RunDirectory::open(folder.path()).unwrap();
    assert_eq!(keep(&mut run, 1, 0.1), (0.1, true));
    assert_eq!(keep(&mut run, 1, 9.0), (0.1, false));
    assert_eq!(keep(&mut run, 2, 0.2), (0.2, true));
    assert_eq!(keep(&mut run, 1, 9.0), (0.1, false));
    assert_eq!(keep(&mut run, 2, 9.0), (0.2, false));
}

/// Records all messages.
#[derive(Default)]
struct Said(std::sync::Mutex<Vec<String>>);

impl Observer for Said {
    fn begin(&self, _: &str, _: &str, _: u64) {}
    fn advance(&self, _: u64) {}
    fn end(&self, _: &str, _: &str) {}
    fn warn(&self, _: &str) {}
    fn note(&self, text: &str) {
        self.0.lock().unwrap().push(text.to_owned());
    }
}

#[test]
fn what_another_version_made_is_made_again_and_kept_but_runs_are_taken() {
    let folder = tempfile::tempdir().unwrap();
    let all = |version: &str, value: f64| {
        let mut run = RunDirectory::open(folder.path()).unwrap();
        run.pretend(version);
        let said = Said::default();
        let runs = run.keep(&Stage::Simulate.folder(), &1, &said, |_| Ok(Number(value))).unwrap();
        let inputs = (2, runs.hash);
        let fitted =
            run.keep(&Stage::Surrogate.folder(), &inputs, &said, |_| Ok(Number(value))).unwrap();
        let inputs = (3, fitted.hash);
        let drawn =
            run.keep(&Stage::Calibrate.folder(), &inputs, &said, |_| Ok(Number(value))).unwrap();
        let values = [runs.value.0, fitted.value.0, drawn.value.0];
        (values, said.0.into_inner().unwrap())
    };
    assert_eq!(all("0.1.0", 0.1), ([0.1; 3], Vec::new()));
    assert_eq!(all("0.1.0", 0.9), ([0.1; 3], Vec::new()));
    let (values, said) = all("0.2.0", 0.2);
    assert_eq!(values, [0.1, 0.2, 0.2]);
    assert_eq!(said.len(), 3, "{said:?}");
    assert_eq!(said[0], "`2-simulate` is reused as made by lacuna 0.1.0");
    let fitted = "`4-surrogate` is repeated: it was made by lacuna 0.1.0, and this is lacuna \
                  0.2.0; the earlier result is kept in .kept/4-surrogate-";
    assert!(said[1].starts_with(fitted), "{}", said[1]);
    let kept = said[1].rsplit(' ').next().unwrap();
    assert!(folder.path().join(kept).join(RECORD).exists(), "{kept}");
    let drawn = "`5-calibrate` is repeated: lacuna 0.1.0 made it from results that are now \
                 repeated";
    assert_eq!(said[2], drawn);
    // Inspecting is no reason to repeat anything.
    let mut run = RunDirectory::open(folder.path()).unwrap();
    run.pretend("0.3.0");
    run.look();
    assert!(run.has(&Stage::Simulate.folder(), &1).unwrap());
    let runs = run.keep(&Stage::Simulate.folder(), &1, &Silent, |_| Ok(Number(0.9))).unwrap();
    let fitted =
        run.keep(&Stage::Surrogate.folder(), &(2, runs.hash), &Silent, |_| Ok(Number(0.9)));
    assert_eq!(fitted.unwrap().value, Number(0.2));
    drop(run);
    // Switching versions back and forth loses nothing.
    assert_eq!(all("0.1.0", 0.9).0, [0.1; 3]);
    assert_eq!(all("0.2.0", 0.9).0, [0.1, 0.2, 0.2]);
}

#[test]
fn a_damaged_artifact_is_made_again() {
    let folder = tempfile::tempdir().unwrap();
    let mut run = RunDirectory::open(folder.path()).unwrap();
    keep(&mut run, 1, 0.1);
    fs::write(folder.path().join("3-read/number.json"), "0.3").unwrap();
    assert_eq!(keep(&mut run, 1, 0.2), (0.2, true));
}

#[test]
fn a_damaged_mark_is_moved_aside_inside_the_directory() {
    for mark in ["short", "ä", "../../../../elsewhere", &"é".repeat(40)] {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path().join("run");
        fs::create_dir_all(root.join("3-read")).unwrap();
        fs::write(root.join("3-read").join(INPUTS), mark).unwrap();
        fs::write(root.join("3-read/number.json"), "0.7").unwrap();
        let mut run = RunDirectory::open(&root).unwrap();
        assert_eq!(keep(&mut run, 1, 0.1), (0.1, true));
        let aside: Vec<_> = fs::read_dir(root.join(".kept")).unwrap().flatten().collect();
        assert_eq!(aside.len(), 1, "{mark}");
        assert_eq!(fs::read_to_string(aside[0].path().join("number.json")).unwrap(), "0.7");
    }
}

#[test]
fn an_interrupted_stage_finds_what_it_wrote() {
    let folder = tempfile::tempdir().unwrap();
    let mut run = RunDirectory::open(folder.path()).unwrap();
    let first = run.keep(&Stage::Read.folder(), &1, &Silent, |folder| {
        files::write_json(&folder.join("half.json"), &0.5)?;
        Err::<Number, _>(Stop::new("killed"))
    });
    assert_eq!(first.unwrap_err().message, "killed");
    let second = run.keep(&Stage::Read.folder(), &1, &Silent, |folder| {
        Ok(Number(files::read_json::<f64>(&folder.join("half.json"))? * 2.0))
    });
    assert_eq!(second.unwrap().value, Number(1.0));
}

#[test]
fn two_processes_do_not_share_a_run() {
    let folder = tempfile::tempdir().unwrap();
    let _first = RunDirectory::open(folder.path()).unwrap();
    let second = RunDirectory::open(folder.path()).unwrap_err();
    assert!(second.message.starts_with("another process is working in"));
    let without_locks = std::io::Error::from(std::io::ErrorKind::Unsupported);
    assert!(!is_taken(&Err(TryLockError::Error(without_locks))));
}
