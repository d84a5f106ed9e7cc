//! The server, and what it says of the model once and for all.

use std::fmt;
use std::sync::OnceLock;
use std::time::Duration;

use lacuna_um_bridge::Client;
use lacuna_um_bridge::client::Error;
use lacuna_um_bridge::protocol::{About, Config, Support};

use super::UmBridge;

/// What is known of the server.
#[derive(Default)]
pub(super) struct Connection {
    client: OnceLock<Client>,
    support: OnceLock<Support>,
    input_sizes: OnceLock<Vec<usize>>,
    output_sizes: OnceLock<Vec<usize>>,
}

impl fmt::Debug for Connection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Connection")
    }
}

/// What is there, or else what is made and then kept; what fails is made again the next time.
fn once<T>(cell: &OnceLock<T>, make: impl FnOnce() -> Result<T, Error>) -> Result<&T, Error> {
    if let Some(value) = cell.get() {
        return Ok(value);
    }
    let value = make()?;
    Ok(cell.get_or_init(|| value))
}

impl UmBridge {
    pub(super) fn client(&self) -> &Client {
        self.connection.client.get_or_init(|| {
            let timeout = Duration::try_from_secs_f64(self.timeout.get()).unwrap_or(Duration::MAX);
            Client::new(&self.url, timeout, self.retries)
        })
    }

    /// The model with these settings.
    pub(super) fn about(&self, config: Config) -> About {
        About { name: self.model.clone(), config }
    }

    /// What the model can be asked for.
    pub(super) fn support(&self) -> Result<Support, Error> {
        let ask = || self.client().support(&self.about(self.config.clone()));
        once(&self.connection.support, ask).copied()
    }

    /// The same from a server that answers at once.
    pub(super) fn support_now(&self) -> Option<Support> {
        let client = || Client::new(&self.url, Duration::from_secs(60), 0);
        let ask = || client().support(&self.about(self.config.clone()));
        once(&self.connection.support, ask).ok().copied()
    }

    /// The length of each input vector, under the settings that the study writes.
    pub(super) fn input_sizes(&self) -> Result<&[usize], Error> {
        let ask = || self.client().input_sizes(&self.about(self.config.clone()));
        once(&self.connection.input_sizes, ask).map(Vec::as_slice)
    }

    /// The length of each output vector, under the settings that the study writes.
    pub(super) fn output_sizes(&self) -> Result<&[usize], Error> {
        let ask = || self.client().output_sizes(&self.about(self.config.clone()));
        once(&self.connection.output_sizes, ask).map(Vec::as_slice)
    }
}
