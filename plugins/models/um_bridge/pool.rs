//! Servers of one model: each question goes to one that is free.

use std::fmt;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use lacuna_um_bridge::Client;
use lacuna_um_bridge::client::Error;

/// Servers with what is under way at each.
pub struct Pool {
    clients: Vec<Client>,
    /// How many questions are under way at a time at each.
    most: usize,
    seats: Mutex<Vec<Seat>>,
    freed: Condvar,
}

#[derive(Default)]
struct Seat {
    busy: usize,
    /// Whether it has ever answered.
    answered: bool,
    /// Why it is left out.
    gone: Option<Error>,
}

/// An input at which so many servers ended is not sent to another.
const MOST_DEATHS: usize = 2;

impl Pool {
    /// Servers at these addresses, with so many questions at a time at each.
    pub fn new(urls: &[String], timeout: Duration, retries: u32, most: usize) -> Self {
        let clients = urls.iter().map(|url| Client::new(url, timeout, retries)).collect();
        let seats = urls.iter().map(|_| Seat::default()).collect();
        Self { clients, most, seats: Mutex::new(seats), freed: Condvar::new() }
    }

    /// The answer of a server that is free. One that is gone is left out, and its question put to another.
    pub fn ask<T>(&self, question: impl Fn(&Client) -> Result<T, Error>) -> Result<T, Error> {
        let mut deaths = 0;
        loop {
            let place = self.take()?;
            let outcome = question(&self.clients[place]);
            let unreachable = matches!(outcome, Err(Error::Unreachable { .. }));
            let worked_before = self.give_back(place, outcome.as_ref().err());
            let Err(error) = outcome else { return outcome };
            if !unreachable || self.clients.len() == 1 {
                return Err(error);
            }
            eprintln!("warning: {error}; it is left out");
            deaths += usize::from(worked_before);
            if deaths == MOST_DEATHS {
                // What ends every server is the input, not the server.
                let Error::Unreachable { url, reason } = error else { return Err(error) };
                let reason =
                    format!("{reason}, the second server that ended while it worked on this");
                return Err(Error::Broken { url, reason });
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
                let last = seats.iter().find_map(|seat| seat.gone.clone());
                let reason = format!("all {} servers are gone", seats.len());
                let none = Error::Unreachable { url: "any address".to_owned(), reason };
                return Err(last.filter(|_| seats.len() == 1).unwrap_or(none));
            }
            seats = self.freed.wait(seats).unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// Notes how a question ended; returns whether the server had answered before.
    fn give_back(&self, place: usize, error: Option<&Error>) -> bool {
        let mut seats = self.seats();
        let alone = seats.len() == 1;
        let seat = &mut seats[place];
        seat.busy -= 1;
        let before = seat.answered;
        match error {
            // A server that is the only one is asked again: there is nobody else.
            Some(error @ Error::Unreachable { .. }) if !alone => seat.gone = Some(error.clone()),
            Some(Error::Unreachable { .. }) => {}
            _ => seat.answered = true,
        }
        drop(seats);
        self.freed.notify_all();
        before
    }
}

impl fmt::Debug for Pool {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Pool")
    }
}
