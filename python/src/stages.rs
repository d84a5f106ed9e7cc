//! Runs of studies.

use std::panic::resume_unwind;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use lacuna::run::{Observer, Stop};
use lacuna_engine::augment::{Begun, add};
use lacuna_engine::pipeline;
use lacuna_engine::study::Study;
use lacuna_engine::study::resolve::Use;
use lacuna_run::RunDirectory;
use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;

use crate::observer::{Channel, Event, Interrupted};
use crate::problems::{Source, stopped};

/// Interval at which a waiting thread looks for signals.
const LOOK: Duration = Duration::from_millis(100);

/// Runs a study in its folder, and searches for missing physics with the purpose `gap`. `tell` is called with the events of
/// the run. Returns the folder of the study with the effects that were added, if there is one.
///
/// # Errors
/// `StudyError` if the study has problems, `RunError` if the run stops, `KeyboardInterrupt`.
#[pyfunction]
pub fn pursue(
    py: Python<'_>,
    source: Source,
    out: PathBuf,
    purpose: &str,
    tell: Bound<'_, PyAny>,
) -> PyResult<Option<PathBuf>> {
    let gap = purpose == "gap";
    let (sender, events) = channel();
    let events = Mutex::new(events);
    let interrupted = Arc::new(AtomicBool::new(false));
    let observer = Channel::new(sender, interrupted.clone());
    let run = thread::spawn(move || {
        let study = source.load(Use::Run)?;
        work(&study, &out, gap, &observer).map_err(|stop| stopped(&stop))
    });
    if let Err(error) = listen(py, &events, &tell) {
        interrupted.store(true, Ordering::Relaxed);
        drop(events);
        // The run ends at its next report.
        let _ = py.detach(|| run.join());
        return Err(error);
    }
    match py.detach(|| run.join()) {
        Ok(result) => result,
        Err(panic) if panic.is::<Interrupted>() => Err(PyKeyboardInterrupt::new_err(())),
        Err(panic) => resume_unwind(panic),
    }
}

/// Passes events on until the run ends.
fn listen(
    py: Python<'_>,
    events: &Mutex<Receiver<Event>>,
    tell: &Bound<'_, PyAny>,
) -> PyResult<()> {
    let next = || events.lock().unwrap_or_else(PoisonError::into_inner).recv_timeout(LOOK);
    loop {
        match py.detach(next) {
            Ok(Event::Begin(stage, unit, total)) => tell.call1(("begin", stage, unit, total))?,
            Ok(Event::Advance(done)) => tell.call1(("advance", done))?,
            Ok(Event::Expect(total)) => tell.call1(("expect", total))?,
            Ok(Event::End(stage, note)) => tell.call1(("end", stage, note))?,
            Ok(Event::Say(kind, text)) => tell.call1((kind, text))?,
            Err(RecvTimeoutError::Timeout) => {
                py.check_signals()?;
                continue;
            }
            Err(RecvTimeoutError::Disconnected) => return Ok(()),
        };
        py.check_signals()?;
    }
}

fn work(
    study: &Study,
    out: &Path,
    gap: bool,
    observer: &dyn Observer,
) -> Result<Option<PathBuf>, Stop> {
    let mut run = RunDirectory::open(out)?;
    if !gap {
        pipeline::run(study, &mut run, observer)?;
        return Ok(None);
    }
    let findings = pipeline::find_gap(study, &mut run, observer)?;
    let Some(found) = &findings.gap else { return Ok(None) };
    let mut wanted = found.clone();
    wanted.result.additions = found.result.worth_adding();
    if wanted.result.additions.is_empty() {
        return Ok(None);
    }
    let begun = Begun {
        study,
        path: &study.file,
        folder: Some(out),
        settings: &[],
        findings: &findings,
        gap: &wanted,
    };
    let (added, _) = add(&begun, &run, observer)?;
    pipeline::find_gap(study, &mut run, observer)?;
    Ok(Some(added.run))
}
