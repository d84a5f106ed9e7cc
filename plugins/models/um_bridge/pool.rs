//! Servers of one model: each question goes to one that is free.

use std::fmt;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use lacuna_um_bridge::Client;
use lacuna_um_bridge::client::Error;

/// Servers with what is under way at each.
pub struct Pool {
    /// They ask once where there are several servers: a question that one does not answer goes to another.
    clients: Vec<Client>,
    /// They ask as often as the study says, whether a server is there at all.
    callers: Vec<Client>,
    /// How many questions are under way at a time at each.
    most: usize,
    seats: Mutex<Vec<Seat>>,
    freed: Condvar,
}

#[derive(Default)]
struct Seat {
    busy: usize,
    /// Why it is left out.
    gone: Option<Error>,
}

/// An input over which so many servers broke the connection is not sent to another.
const MOST_DEATHS: usize = 2;

impl Pool {
    /// Servers at these addresses, with so many questions at a time at each.
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

    /// The answer of a server that is free. One that is gone is left out, and its question put to another.
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
                        eprintln!("warning: {error}; it is left out");
                    }
                    self.give_back(place, gone);
                }
                Err(Error::Broken { url, reason }) => {
                    self.give_back(place, None);
                    deaths += 1;
                    if deaths == MOST_DEATHS {
                        // What ends every server is the input, not the server.
                        let reason =
                            format!("{reason}, the second server to do so over this input");
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

    /// Waits for a server that is free: that with the least to do.
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
                let reason = format!("all {} servers are gone", seats.len());
                return Err(Error::Unreachable { url: "any address".to_owned(), reason });
            }
            seats = self.freed.wait(seats).unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// Frees a server, or leaves it out.
    fn give_back(&self, place: usize, gone: Option<Error>) {
        let mut seats = self.seats();
        seats[place].busy -= 1;
        // Another question may have found it gone before.
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
