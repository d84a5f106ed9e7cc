//! Connection to the server, and the properties of the model that do not change.

use std::fmt;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use lacuna::text::values::Count;
use lacuna_um_bridge::Client;
use lacuna_um_bridge::client::Error;
use lacuna_um_bridge::protocol::{About, Config, Support};

use super::UmBridge;
use super::pool::Pool;

/// Connection to the server and the answers it has given, each requested when first needed.
#[derive(Default)]
pub(super) struct Connection {
    pool: OnceLock<Pool>,
    support: OnceLock<Support>,
    input_sizes: OnceLock<Vec<usize>>,
    output_sizes: OnceLock<Vec<usize>>,
    /// True if the servers are left alone: what can be done without their answers is done so.
    left_alone: AtomicBool,
}

impl fmt::Debug for Connection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Connection")
    }
}

/// The value of the cell. If it is empty, `make` computes it; an error is not stored, so that the next call tries
/// again.
fn once<T>(cell: &OnceLock<T>, make: impl FnOnce() -> Result<T, Error>) -> Result<&T, Error> {
    if let Some(value) = cell.get() {
        return Ok(value);
    }
    let value = make()?;
    Ok(cell.get_or_init(|| value))
}

impl UmBridge {
    /// Answer of a server that is free.
    pub(super) fn ask<T>(
        &self,
        question: impl Fn(&Client) -> Result<T, Error>,
    ) -> Result<T, Error> {
        let pool = self.connection.pool.get_or_init(|| {
            let timeout = self.timeout.seconds();
            let alone = if self.urls.is_empty() { usize::MAX } else { 1 };
            let most = self.parallel.map_or(alone, Count::get);
            Pool::new(self.addresses(), timeout, self.retries, most)
        });
        pool.ask(question)
    }

    /// Leaves the servers alone from now on, as `lacuna check` does.
    pub(super) fn leave_servers_alone(&self) {
        self.connection.left_alone.store(true, Ordering::Relaxed);
    }

    /// The addresses of the servers.
    pub(super) fn addresses(&self) -> &[String] {
        if self.urls.is_empty() { std::slice::from_ref(&self.url) } else { &self.urls }
    }

    /// Address of the model for messages.
    pub(super) fn place(&self) -> String {
        match self.addresses() {
            [only] => only.clone(),
            all => format!("{} and {} other addresses", all[0], all.len() - 1),
        }
    }

    /// The model with these settings.
    pub(super) fn about(&self, config: Config) -> About {
        About { name: self.model.clone(), config }
    }

    /// Operations that the model supports.
    pub(super) fn support(&self) -> Result<Support, Error> {
        let ask = || self.ask(|client| client.support(&self.about(self.config.clone())));
        once(&self.connection.support, ask).copied()
    }

    /// Operations that the model supports, from the first server that answers within a minute, without repeated
    /// requests; `None` if none does, or if they are left alone.
    pub(super) fn support_now(&self) -> Option<Support> {
        if self.connection.left_alone.load(Ordering::Relaxed) {
            return None;
        }
        let ask = || {
            let about = self.about(self.config.clone());
            let of = |url: &String| Client::new(url, Duration::from_secs(60), 0).support(&about);
            let mut answers = self.addresses().iter().map(of);
            let first = answers.next().unwrap_or_else(|| unreachable!("there is an address"));
            first.or_else(|error| answers.find_map(Result::ok).ok_or(error))
        };
        once(&self.connection.support, ask).ok().copied()
    }

    /// The length of each input vector, under the settings that the study gives.
    pub(super) fn input_sizes(&self) -> Result<&[usize], Error> {
        let ask = || self.ask(|client| client.input_sizes(&self.about(self.config.clone())));
        once(&self.connection.input_sizes, ask).map(Vec::as_slice)
    }

    /// The length of each output vector, under the settings that the study gives.
    pub(super) fn output_sizes(&self) -> Result<&[usize], Error> {
        let ask = || self.ask(|client| client.output_sizes(&self.about(self.config.clone())));
        once(&self.connection.output_sizes, ask).map(Vec::as_slice)
    }
}
