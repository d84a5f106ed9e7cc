//! A file of plugins and its workers.

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use lacuna::matrix::Matrix;
use lacuna::plugin::Target;
use lacuna_abi::{Refusal, status};
use serde_json::{Map, Value as Json, json};

use crate::message::Message;
use crate::worker::Worker;

/// A file of plugins. Each request takes a worker that is free, or starts another one; every worker can make every object.
#[derive(Debug)]
pub struct Script {
    file: PathBuf,
    interpreter: PathBuf,
    free: Mutex<Vec<Worker>>,
    next: AtomicU64,
    /// Objects that nobody uses any more, which workers may still hold.
    dropped: Mutex<BTreeSet<u64>>,
}

/// An object of the Python side, and how a worker makes it.
#[derive(Debug)]
pub struct Recipe {
    script: Arc<Script>,
    id: u64,
    parent: Option<Arc<Recipe>>,
    /// The request that makes it; `forget` is added when it is sent.
    request: Message,
}

impl Drop for Recipe {
    fn drop(&mut self) {
        lock(&self.script.dropped).insert(self.id);
    }
}

fn lock<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A request: what to do with an object, and with what.
pub struct Request<'a> {
    /// The object.
    pub object: &'a Arc<Recipe>,
    /// Name of what is done with it, and arguments.
    pub head: Map<String, Json>,
    /// Conditions that many requests share, which the head leaves out.
    pub known: Option<&'a Arc<Recipe>>,
    /// Numbers.
    pub matrices: &'a [&'a Matrix],
    /// Bytes.
    pub bytes: &'a [u8],
}

impl Script {
    /// A file whose first worker is there.
    pub fn new(file: PathBuf, interpreter: PathBuf, worker: Worker) -> Self {
        let (next, dropped) = (AtomicU64::new(1), Mutex::default());
        Self { file, interpreter, free: Mutex::new(vec![worker]), next, dropped }
    }

    /// An object that a request makes from another one, or from nothing.
    pub fn recipe(
        self: &Arc<Self>,
        parent: Option<Arc<Recipe>>,
        mut request: Message,
    ) -> Arc<Recipe> {
        let id = self.next.fetch_add(1, Ordering::Relaxed);
        match &parent {
            None => request.head.insert("id".to_owned(), json!(id)),
            Some(parent) => {
                request.head.insert("id".to_owned(), json!(parent.id));
                request.head.insert("makes".to_owned(), json!(id))
            }
        };
        Arc::new(Recipe { script: self.clone(), id, parent, request })
    }

    fn worker(&self) -> Result<Worker, Refusal> {
        loop {
            let Some(mut worker) = lock(&self.free).pop() else { break };
            if worker.is_running() {
                return Ok(worker);
            }
        }
        let started = Worker::start(&self.interpreter, &self.file).map_err(Refusal::stop)?;
        accepted(started.1).map(|_| started.0)
    }

    /// The answer of a worker that makes an object, which is then there.
    pub fn made(&self, recipe: &Arc<Recipe>) -> Result<Message, Refusal> {
        let mut worker = self.worker()?;
        let made = prepared(&mut worker, recipe, None);
        self.kept(worker);
        made.map(Option::unwrap_or_default)
    }

    /// The answer to a request; `target` answers the questions of a sampler.
    pub fn ask(
        &self,
        request: &Request<'_>,
        target: Option<&dyn Target>,
    ) -> Result<Message, Refusal> {
        let mut worker = self.worker()?;
        let gone = self.gone(&worker);
        let answer = answer(&mut worker, request, target, gone);
        self.kept(worker);
        answer
    }

    /// Objects of a worker that nobody uses any more.
    fn gone(&self, worker: &Worker) -> Vec<u64> {
        lock(&self.dropped).intersection(&worker.objects).copied().collect()
    }

    fn kept(&self, mut worker: Worker) {
        if worker.is_running() {
            lock(&self.free).push(worker);
        }
    }
}

/// Makes an object and those that it needs, unless the worker has them; `None` if it has.
fn prepared(
    worker: &mut Worker,
    recipe: &Arc<Recipe>,
    target: Option<&dyn Target>,
) -> Result<Option<Message>, Refusal> {
    if worker.objects.contains(&recipe.id) {
        return Ok(None);
    }
    if let Some(parent) = &recipe.parent {
        prepared(worker, parent, target)?;
    }
    let matrices: Vec<&Matrix> = recipe.request.matrices.iter().collect();
    worker.say(&recipe.request.head, &matrices, &recipe.request.bytes);
    let said = heard(worker, target)?;
    worker.objects.insert(recipe.id);
    Ok(Some(said))
}

fn answer(
    worker: &mut Worker,
    request: &Request<'_>,
    target: Option<&dyn Target>,
    gone: Vec<u64>,
) -> Result<Message, Refusal> {
    prepared(worker, request.object, target)?;
    let mut head = request.head.clone();
    head.insert("id".to_owned(), json!(request.object.id));
    if let Some(known) = request.known {
        prepared(worker, known, target)?;
        head.insert("known".to_owned(), json!(known.id));
    }
    if !gone.is_empty() {
        for id in &gone {
            worker.objects.remove(id);
        }
        head.insert("forget".to_owned(), json!(gone));
    }
    worker.say(&head, request.matrices, request.bytes);
    heard(worker, target)
}

/// The answer to what was said last, after the questions that the worker asks meanwhile.
fn heard(worker: &mut Worker, target: Option<&dyn Target>) -> Result<Message, Refusal> {
    loop {
        let message = worker.hear().map_err(|how| Refusal::stop(format!("its worker {how}")))?;
        let Some(what) = message.head.get("ask").and_then(Json::as_str) else {
            return accepted(message);
        };
        match density(what, &message, target) {
            Ok(matrices) => {
                let matrices: Vec<&Matrix> = matrices.iter().collect();
                worker.say(&Map::new(), &matrices, &[]);
            }
            Err(text) => {
                let head = Map::from_iter([("error".to_owned(), Json::from(text))]);
                worker.say(&head, &[], &[]);
            }
        }
    }
}

/// The log density, the log prior or the gradient at points.
fn density(
    what: &str,
    message: &Message,
    target: Option<&dyn Target>,
) -> Result<Vec<Matrix>, String> {
    let (Some(target), [points]) = (target, &message.matrices[..]) else {
        return Err("there is no log density here".to_owned());
    };
    let (found, dimension) = (points.columns(), target.dimension());
    if found != dimension {
        return Err(format!("the density has {dimension} unknowns, found points of {found}"));
    }
    let row = |values: Vec<f64>| Matrix::from_vec(1, values.len(), values);
    match what {
        "log_density" => Ok(vec![row(target.log_density(points))]),
        "log_prior" => Ok(vec![row(target.log_prior(points))]),
        "gradient" if points.rows() == 1 => {
            let (value, gradient) = target.gradient(points.as_slice());
            Ok(vec![row(vec![value]), row(gradient)])
        }
        _ => Err(format!("`{what}` of {} points is not known", points.rows())),
    }
}

/// An answer that is no refusal.
fn accepted(message: Message) -> Result<Message, Refusal> {
    let said = |key: &str| message.head.get(key);
    if let Some(complaints) = said("complaints") {
        return Err(Refusal::new(status::REJECTED, complaints.to_string()));
    }
    let text = |json: &Json| json.as_str().unwrap_or_default().to_owned();
    if let Some(reason) = said("rejected") {
        return Err(Refusal::new(status::REJECTED, text(reason)));
    }
    match said("error") {
        Some(reason) => Err(Refusal::stop(text(reason))),
        None => Ok(message),
    }
}
