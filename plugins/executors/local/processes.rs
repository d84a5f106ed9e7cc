//! Processes of this machine, each of which makes one run at a time.

use std::collections::VecDeque;
use std::fs::File;
use std::io::{self, BufRead as _, BufReader, Write as _};
use std::path::PathBuf;
use std::process::{ChildStdin, ChildStdout, Command, ExitStatus, Stdio};
use std::sync::{Mutex, PoisonError, mpsc};

use lacuna::plugin::executor::{Batch, Finished, Job};
use lacuna::run::{Stop, files};
use lacuna_run::work::{Begun, Marker, Order, Outcome, folder};

use super::Local;
use crate::executors::program::program;
use lacuna_run::process::{Process, tail_of_file};

/// Runs the jobs of a batch in several processes and reports each as it ends.
pub fn submit(
    options: &Local,
    processes: usize,
    batch: &Batch<'_>,
    finished: &mut dyn FnMut(Finished) -> Result<(), Stop>,
) -> Result<(), Stop> {
    if batch.jobs.is_empty() {
        return Ok(());
    }
    let order_folder = folder(batch.directory).join("local");
    let order = Order::new(batch, batch.jobs.to_vec(), Vec::new());
    order.write(&order_folder)?;
    // An earlier attempt may have ended because no run could have a result; the cause may have been corrected since.
    batch.jobs.iter().try_for_each(|job| Marker::clear_hopeless(batch.directory, &job.name))?;
    let processes = processes.min(batch.jobs.len());
    let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let office = Office {
        program: program(options.program.as_deref(), batch.study)?,
        order: std::path::absolute(&order_folder).unwrap_or(order_folder),
        asked: order.fingerprints()?,
        processes,
        threads: (cores / processes).max(1),
        options,
        batch,
        waiting: Mutex::new(packed(batch)),
    };
    std::thread::scope(|scope| {
        let (sender, receiver) = mpsc::channel();
        for part in 0..processes {
            let (sender, office) = (sender.clone(), &office);
            scope.spawn(move || {
                if let Err(stop) = office.serve(part, &sender) {
                    let _ = sender.send(Err(stop));
                }
            });
        }
        drop(sender);
        let result = receiver.iter().try_for_each(|ended| finished(ended?));
        office.close();
        // Runs in progress are no longer needed, but one that ends now still leaves its marker.
        result
    })
}

/// Returns the jobs in groups of the model's preferred batch size.
fn packed(batch: &Batch<'_>) -> VecDeque<Vec<usize>> {
    let all: Vec<usize> = (0..batch.jobs.len()).collect();
    all.chunks(batch.model.batch().max(1)).map(<[usize]>::to_vec).collect()
}

/// Distribution of the runs to the processes.
struct Office<'a> {
    program: PathBuf,
    order: PathBuf,
    asked: Vec<String>,
    processes: usize,
    threads: usize,
    options: &'a Local,
    batch: &'a Batch<'a>,
    waiting: Mutex<VecDeque<Vec<usize>>>,
}

type Sender = mpsc::Sender<Result<Finished, Stop>>;

impl Office<'_> {
    /// Makes runs in one process after the other until none are left; a process that dies is replaced.
    fn serve(&self, part: usize, sender: &Sender) -> Result<(), Stop> {
        let mut worker = None;
        while let Some(jobs) = self.take() {
            let mut mine = match worker.take() {
                Some(worker) => worker,
                None => self.start(part)?,
            };
            if mine.ask(jobs.iter().map(|&i| &self.batch.jobs[i])) {
                worker = Some(mine);
                self.hand_over(&jobs, "its process did not report it", sender)?;
            } else {
                self.bury(mine, &jobs, sender)?;
            }
        }
        Ok(())
    }

    fn take(&self) -> Option<Vec<usize>> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner).pop_front()
    }

    fn close(&self) {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner).clear();
    }

    /// Handles a process that ended before it had made its runs.
    fn bury(&self, worker: Worker, jobs: &[usize], sender: &Sender) -> Result<(), Stop> {
        let (number, log) = (worker.process_number, worker.log.clone());
        let status = worker.end().map_err(|error| self.cannot_start(&error))?;
        let said = tail_of_file(&log);
        let begun = |i: &usize| {
            let begun = Begun::read(self.batch.directory, &self.batch.jobs[*i].name);
            begun.is_some_and(|begun| begun.process == number && begun.asked == self.asked[*i])
        };
        let marked = |i: &usize| self.marker(*i).is_some();
        if !jobs.iter().any(|i| begun(i) || marked(i)) {
            // The process died for a reason other than a run, and so would the next one.
            return Err(Stop::new(format!(
                "`{} work` {}: {said}",
                self.program.display(),
                how_it_ended(status)
            )));
        }
        let lost: Vec<usize> = jobs.iter().copied().filter(|i| !marked(i)).collect();
        if jobs.len() > 1 && lost.len() > 1 {
            // Made one by one, the runs show which of them is at fault.
            let mut waiting = self.waiting.lock().unwrap_or_else(PoisonError::into_inner);
            lost.iter().rev().for_each(|&i| waiting.push_front(vec![i]));
            drop(waiting);
            let ended: Vec<usize> = jobs.iter().copied().filter(marked).collect();
            return self.hand_over(&ended, "", sender);
        }
        self.hand_over(jobs, &reason(status, &said, self.options), sender)
    }

    fn marker(&self, i: usize) -> Option<Marker> {
        Marker::read(self.batch.directory, &self.batch.jobs[i].name, &self.asked[i])
    }

    /// Reports the outcomes in the markers of some runs; runs without a marker fail with the reason `lost`.
    fn hand_over(&self, jobs: &[usize], lost: &str, sender: &Sender) -> Result<(), Stop> {
        for &index in jobs {
            let (outcome, seconds) = match self.marker(index) {
                Some(marker) => (
                    match marker.outcome {
                        Outcome::Done { made, .. } => Ok(made),
                        Outcome::Failed { reason } => Err(reason),
                        Outcome::Hopeless { reason } => return Err(Stop::new(reason)),
                    },
                    marker.seconds,
                ),
                None => (Err(lost.to_owned()), 0.0),
            };
            if outcome.is_err() {
                Marker::set_aside(self.batch.directory, &self.batch.jobs[index].name)?;
            }
            if sender.send(Ok(Finished { index, outcome, seconds })).is_err() {
                self.close();
            }
        }
        Ok(())
    }

    fn start(&self, part: usize) -> Result<Worker, Stop> {
        let log = self.order.join(format!("process{}.txt", part + 1));
        let file = File::create(&log).map_err(|error| files::cannot_write(&log, &error))?;
        let mut command = Command::new(&self.program);
        command.arg("work").arg(&self.order);
        if self.options.pin {
            command.args(["--part", &format!("{part}/{}", self.processes)]);
        }
        if let Some(memory) = &self.options.memory {
            command.args(["--memory", &memory.bytes().to_string()]);
        }
        // Threads within a run share the machine with the other processes.
        command.env("RAYON_NUM_THREADS", self.threads.to_string());
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(file);
        let started = Worker::start(&mut command, log);
        started.map_err(|error| self.cannot_start(&error))
    }

    fn cannot_start(&self, error: &io::Error) -> Stop {
        let program = self.program.display();
        Stop::new(format!("cannot run `{program}`: {}", files::in_words(error)))
    }
}

/// A process that makes the runs it is asked for.
struct Worker {
    process: Process,
    process_number: u32,
    questions: ChildStdin,
    answers: BufReader<ChildStdout>,
    log: PathBuf,
}

impl Worker {
    fn start(command: &mut Command, log: PathBuf) -> io::Result<Self> {
        let mut process = Process::start(command)?;
        let child = process.child();
        let (questions, answers) = (child.stdin.take(), child.stdout.take());
        let process_number = child.id();
        let (Some(questions), Some(answers)) = (questions, answers) else {
            return Err(io::ErrorKind::BrokenPipe.into());
        };
        Ok(Self { process, process_number, questions, answers: BufReader::new(answers), log })
    }

    /// Has some runs made; returns false if the process has ended.
    fn ask<'a>(&mut self, jobs: impl Iterator<Item = &'a Job>) -> bool {
        let names: Vec<&str> = jobs.map(|job| job.name.as_str()).collect();
        let (question, answer) = (names.join(" ") + "\n", format!("done {}", names.join(" ")));
        if self.questions.write_all(question.as_bytes()).is_err() {
            return false;
        }
        let mut line = String::new();
        // Other lines are output of the model.
        while self.answers.read_line(&mut line).is_ok_and(|bytes| bytes > 0) {
            if line.trim_end() == answer {
                return true;
            }
            line.clear();
        }
        false
    }

    fn end(mut self) -> io::Result<ExitStatus> {
        // The process has closed its pipe, so that it has ended or is about to.
        let status = self.process.wait(Some(std::time::Duration::from_secs(5)))?;
        status.map_or_else(|| self.process.end(), Ok)
    }
}

fn how_it_ended(status: ExitStatus) -> String {
    #[cfg(unix)]
    if let Some(signal) = std::os::unix::process::ExitStatusExt::signal(&status) {
        return format!("was ended by signal {signal}");
    }
    status.code().map_or("ended".to_owned(), |code| format!("ended with exit code {code}"))
}

/// Returns the reason for which a run has no result, as far as it is known.
fn reason(status: ExitStatus, said: &str, options: &Local) -> String {
    let how = how_it_ended(status);
    let lines = if said.is_empty() { String::new() } else { format!(": {said}") };
    let short_of_memory = said.contains("memory allocation") || said.contains("out of memory");
    match &options.memory {
        Some(memory) if short_of_memory => {
            format!("its process ran out of memory ({memory}) and {how}{lines}")
        }
        _ if how.ends_with("signal 9") => {
            format!("its process {how}, which is how a system ends one when memory runs out{lines}")
        }
        _ => format!("its process {how}{lines}"),
    }
}
