//! A Python process that has loaded the user's file and answers calls.

use std::io::{self, BufReader, Read, Write as _};
use std::path::Path;
use std::process::{ChildStdin, Command, Stdio};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError};
use std::thread;
use std::time::Duration;

use lacuna::data::{Layout, Scenario};
use lacuna::plugin::model::Call;
use serde_json::{Value, json};

use super::frame::{self, Answer};
use crate::models::given::{layout_document, scenario_document};
use lacuna_run::process::{Printed, Process, ending, keep_freed_memory};

const SCRIPT: &str =
    concat!(include_str!("../../../python/lacuna/user_file.py"), include_str!("worker.py"));

/// Data that do not change from call to call.
#[derive(Debug)]
struct Settings {
    names: Vec<String>,
    layout: Layout,
    scenario: Scenario,
}

impl Settings {
    fn of(call: &Call<'_>) -> Self {
        Self {
            names: call.names.to_vec(),
            layout: call.layout.clone(),
            scenario: call.scenario.clone(),
        }
    }

    fn fit(&self, call: &Call<'_>) -> bool {
        self.names == call.names && self.layout == *call.layout && self.scenario == *call.scenario
    }
}

/// Reason for a missing answer.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Silent {
    /// Error message of the worker, which is ready for the next request.
    Failed(String),
    /// The time limit has passed.
    Late,
    /// The worker has ended; the text describes how.
    Ended(String),
}

/// A worker process.
#[derive(Debug)]
pub struct Worker {
    process: Process,
    requests: ChildStdin,
    answers: Receiver<io::Result<Answer>>,
    printed: Printed,
    settings: Option<Settings>,
}

impl Worker {
    /// Starts a worker and waits until it has loaded the file. `limit` is the time limit for that; no limit if
    /// `None`.
    pub fn start(
        interpreter: &Path,
        arguments: &[String],
        study: &Path,
        limit: Option<Duration>,
    ) -> Result<Self, Silent> {
        let ended = |error: io::Error| Silent::Ended(format!("cannot be run: {error}"));
        let mut command = Command::new(interpreter);
        command.args(["-c", SCRIPT]).args(arguments).current_dir(study);
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        keep_freed_memory(&mut command);
        let mut process = Process::start(&mut command).map_err(ended)?;
        let child = process.child();
        let (Some(requests), Some(output), Some(errors)) =
            (child.stdin.take(), child.stdout.take(), child.stderr.take())
        else {
            return Err(Silent::Ended("has no pipes".to_owned()));
        };
        let answers = listen(output);
        let printed = Printed::of(errors);
        let mut worker = Self { process, requests, answers, printed, settings: None };
        worker.hear(limit)?;
        Ok(worker)
    }

    /// Sends the data that do not change from call to call, unless the worker has them already.
    pub fn prepare(&mut self, call: &Call<'_>, limit: Option<Duration>) -> Result<(), Silent> {
        if self.settings.as_ref().is_some_and(|settings| settings.fit(call)) {
            return Ok(());
        }
        let document = json!({
            "names": call.names,
            "layout": layout_document(call.layout),
            "scenario": scenario_document(call.scenario),
        });
        match self.ask(&document, limit)? {
            Answer::Failed(text) => Err(Silent::Failed(text)),
            Answer::Values(_) => {
                self.settings = Some(Settings::of(call));
                Ok(())
            }
        }
    }

    /// Returns `true` if the worker is ready for a request.
    pub fn is_running(&mut self) -> bool {
        self.process.is_running()
    }

    /// Answer to a request.
    pub fn ask(&mut self, request: &Value, limit: Option<Duration>) -> Result<Answer, Silent> {
        // A worker that does not read any more has ended; the missing answer is then explained by its exit status.
        let _ = self.requests.write_all(format!("{request}\n").as_bytes());
        self.hear_any(limit)
    }

    fn hear(&mut self, limit: Option<Duration>) -> Result<(), Silent> {
        match self.hear_any(limit)? {
            Answer::Values(_) => Ok(()),
            Answer::Failed(text) => Err(Silent::Failed(text)),
        }
    }

    fn hear_any(&mut self, limit: Option<Duration>) -> Result<Answer, Silent> {
        let heard = match limit {
            Some(limit) => self.answers.recv_timeout(limit),
            None => self.answers.recv().map_err(RecvTimeoutError::from),
        };
        match heard {
            Ok(Ok(answer)) => Ok(answer),
            Err(RecvTimeoutError::Timeout) => {
                // An error means that the process has already ended.
                let _ = self.process.end();
                Err(Silent::Late)
            }
            Ok(Err(_)) | Err(RecvTimeoutError::Disconnected) => Err(Silent::Ended(self.death())),
        }
    }

    /// Description of how the worker ended.
    fn death(&mut self) -> String {
        let status = self.process.wait(Some(Duration::from_secs(1)));
        ending(status.ok().flatten(), &self.printed)
    }
}

/// Reads answers in a thread, so that waiting for them can have a limit.
fn listen(output: impl Read + Send + 'static) -> Receiver<io::Result<Answer>> {
    let (sender, receiver) = mpsc::channel();
    thread::spawn(move || {
        let mut output = BufReader::new(output);
        while let Some(answer) = frame::read(&mut output).transpose() {
            let last = answer.is_err();
            if sender.send(answer).is_err() || last {
                break;
            }
        }
    });
    receiver
}
