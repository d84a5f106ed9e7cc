//! A Python process that has loaded a file of plugins.

use std::collections::BTreeSet;
use std::io::BufReader;
use std::path::Path;
use std::process::{ChildStdin, ChildStdout, Command, Stdio};
use std::sync::LazyLock;
use std::time::Duration;

use lacuna::matrix::Matrix;
use lacuna_run::process::{Printed, Process, ending, keep_freed_memory};
use serde_json::{Map, Value as Json, json};

use crate::message::{self, Message};

/// The Python side: the modules of the package `lacuna` that a worker needs, as the package ships them.
const MODULES: [(&str, &str); 4] = [
    ("user_file", include_str!("../../../python/lacuna/user_file.py")),
    ("plugin", include_str!("../../../python/lacuna/plugin.py")),
    ("serve", include_str!("../../../python/lacuna/serve.py")),
    ("worker", include_str!("../../../python/lacuna/worker.py")),
];

/// Makes the modules and starts the worker. What a file of plugins imports as `lacuna` is this, whether or not the package is
/// installed, so that both sides are of the same version.
static PROGRAM: LazyLock<String> = LazyLock::new(|| {
    let modules: Vec<Json> = MODULES.iter().map(|(name, text)| json!([name, text])).collect();
    format!(
        "import sys, types\n\
         try:\n    \
             import numpy\n\
         except ImportError:\n    \
             sys.exit('NumPy is not installed for this interpreter, and plugins in Python need it')\n\
         package = types.ModuleType('lacuna')\n\
         package.__path__ = []\n\
         sys.modules['lacuna'] = package\n\
         for name, text in {}:\n    \
             module = types.ModuleType('lacuna.' + name)\n    \
             module.__package__ = 'lacuna'\n    \
             sys.modules[module.__name__] = module\n    \
             setattr(package, name, module)\n    \
             exec(compile(text, '<lacuna.' + name + '>', 'exec'), module.__dict__)\n\
         for name in package.plugin.__all__:\n    \
             setattr(package, name, getattr(package.plugin, name))\n\
         package.worker.main(sys.argv[1])\n",
        Json::from(modules)
    )
});

/// A worker process.
#[derive(Debug)]
pub struct Worker {
    process: Process,
    requests: ChildStdin,
    answers: BufReader<ChildStdout>,
    printed: Printed,
    /// The objects that it holds.
    pub objects: BTreeSet<u64>,
}

impl Worker {
    /// Starts a worker; returns it with what it says of the plugins of the file.
    pub fn start(interpreter: &Path, file: &Path) -> Result<(Self, Message), String> {
        let mut command = Command::new(interpreter);
        command.args(["-c", &PROGRAM]).arg(file);
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        keep_freed_memory(&mut command);
        let shown = interpreter.display();
        let mut process = Process::start(&mut command)
            .map_err(|error| format!("`{shown}` cannot be run: {error}"))?;
        let child = process.child();
        let (Some(requests), Some(output), Some(errors)) =
            (child.stdin.take(), child.stdout.take(), child.stderr.take())
        else {
            return Err(format!("`{shown}` has no pipes"));
        };
        widen(&requests);
        widen(&output);
        let (answers, printed) = (BufReader::new(output), Printed::of(errors));
        let objects = BTreeSet::new();
        let mut worker = Self { process, requests, answers, printed, objects };
        let said = worker.hear().map_err(|how| format!("the interpreter `{shown}` {how}"))?;
        Ok((worker, said))
    }

    /// True for a worker that can take a request.
    pub fn is_running(&mut self) -> bool {
        self.process.is_running()
    }

    /// The next message; the error says how the worker ended.
    pub fn hear(&mut self) -> Result<Message, String> {
        if let Ok(Some(message)) = Message::read(&mut self.answers) {
            return Ok(message);
        }
        let status = self.process.wait(Some(Duration::from_secs(1)));
        Err(ending(status.ok().flatten(), &self.printed))
    }

    /// Sends a message. A worker that does not read any more has ended, which explains the missing answer.
    pub fn say(&mut self, head: &Map<String, Json>, matrices: &[&Matrix], bytes: &[u8]) {
        let _ = message::write(&mut self.requests, head, matrices, bytes);
    }
}

/// Lets a pipe hold a million bytes, so that the numbers of many points cross without a change of the process for every 64 kB;
/// where the system refuses, it keeps its size.
#[cfg(target_os = "linux")]
fn widen(pipe: &impl std::os::fd::AsFd) {
    let _ = rustix::pipe::fcntl_setpipe_size(pipe, 1 << 20);
}

#[cfg(not(target_os = "linux"))]
fn widen<P>(_pipe: &P) {}
