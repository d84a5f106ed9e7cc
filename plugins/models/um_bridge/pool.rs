//! Servers of one model: each request goes to one that is free.

use std::fmt;
use std::io::Write as _;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use lacuna_um_bridge::Client;
use lacuna_um_bridge::client::Error;

/// Servers with the requests in progress at each.
pub struct Pool {
    /// Clients for evaluations. With several servers they do not repeat a request: one that a server does not answer
    /// goes to another.
    clients: Vec<Client>,
    /// Clients with the study's number of repetitions, for the decision whether a server can be reached at all.
    callers: Vec<Client>,
    /// Maximum number of concurrent requests at each server.
    most: usize,
    seats: Mutex<Vec<Seat>>,
    freed: Condvar,
}

#[derive(Default)]
struct Seat {
    busy: usize,
    /// Reason why the server is not used any more.
    gone: Option<Error>,
}

/// Number of servers that may break the connection for one input before its run has failed.
const MOST_DEATHS: usize = 2;

impl Pool {
    /// Servers at these addresses, each with at most `most` concurrent requests.
    pub fn new(urls: &[String], timeout: Duration, retries: u32, most: usize) -> Self {
        let client =
            |retries: u32| move |url: &String| -> Client { Client::new(url, timeout, retries) };
        let once = if urls.len() == 1 { retries } else { 0 };
        let seats = urls.iter().map(|_| Seat::default()).collect();
        Self {
            clients: urls.iter().map(client(once)).collect(),
            callers: urls.iter().map(client(retries)).collect(),
            most,
            seats: Mutex::new(seats),
            freed: Condvar::new(),
        }
    }

    /// Answer of a server that is free. A server that cannot be reached is not used any more, and its request goes to
    /// another. Fails if no server is left.
    pub fn ask<T>(&self, question: impl Fn(&Client) -> Result<T, Error>) -> Result<T, Error> {
        let mut deaths = 0;
        loop {
            let place = self.take()?;
            let outcome = question(&self.clients[place]);
            if self.clients.len() == 1 {
                self.give_back(place, None);
                return outcome;
            }
            match outcome {
                Err(Error::Unreachable { .. }) => {
                    let gone = self.callers[place].info().err();
                    if let Some(error) = &gone {
                        // Who closes the pipe of errors has no use for them.
                        let _ = writeln!(
                            std::io::stderr(),
                            "warning: {error}; this server is not used any more"
                        );
                    }
                    self.give_back(place, gone);
                }
                Err(Error::Broken { url, reason }) => {
                    self.give_back(place, None);
                    deaths += 1;
                    if deaths == MOST_DEATHS {
                        // The cause is then the input and not a server.
                        let reason = format!(
                            "{reason}; a second server broke the connection for the same input"
                        );
                        return Err(Error::Broken { url, reason });
                    }
                }
                outcome => {
                    self.give_back(place, None);
                    return outcome;
                }
            }
        }
    }

    fn seats(&self) -> MutexGuard<'_, Vec<Seat>> {
        self.seats.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits for a free server and returns the one with the fewest requests.
    fn take(&self) -> Result<usize, Error> {
        let mut seats = self.seats();
        loop {
            let here = || seats.iter().enumerate().filter(|(_, seat)| seat.gone.is_none());
            let free = here().filter(|(_, seat)| seat.busy < self.most);
            if let Some((place, _)) = free.min_by_key(|(place, seat)| (seat.busy, *place)) {
                seats[place].busy += 1;
                return Ok(place);
            }
            if here().next().is_none() {
                let reason = format!("none of the {} servers can be reached any more", seats.len());
                return Err(Error::Unreachable { url: "any address".to_owned(), reason });
            }
            seats = self.freed.wait(seats).unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// Marks a request as completed; with an error, the server is not used any more.
    fn give_back(&self, place: usize, gone: Option<Error>) {
        let mut seats = self.seats();
        seats[place].busy -= 1;
        // Another request may have found earlier that the server cannot be reached.
        if gone.is_some() {
            seats[place].gone = gone;
        }
        drop(seats);
        self.freed.notify_all();
    }
}

impl fmt::Debug for Pool {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Pool")
    }
}
