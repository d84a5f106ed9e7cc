//! The port of a server, and its threads.

use std::io;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::time::Duration;

use super::{Site, connection};

/// Largest number of open connections.
const CONNECTIONS: usize = 512;

/// A port that is bound and does not respond yet.
pub struct Listener {
    socket: TcpListener,
    address: SocketAddr,
    stopper: Stopper,
}

/// Stops a server, from any thread.
#[derive(Clone)]
pub struct Stopper {
    stopped: Arc<AtomicBool>,
    address: SocketAddr,
}

impl Stopper {
    /// Makes the server complete its pending requests and end.
    pub fn stop(&self) {
        self.stopped.store(true, Ordering::SeqCst);
        // The server is blocked waiting for a connection; this one makes it notice the flag.
        let _ = TcpStream::connect_timeout(&self.address, Duration::from_secs(1));
    }

    pub(super) fn is_stopped(&self) -> bool {
        self.stopped.load(Ordering::SeqCst)
    }
}

/// Data shared by all connections.
pub(super) struct Shared<'a> {
    pub(super) site: &'a dyn Site,
    pub(super) stopper: &'a Stopper,
    open: AtomicUsize,
    pub(super) answered: AtomicU64,
}

impl Listener {
    /// Binds a port of an address; port 0 takes any free port.
    pub fn bind(host: IpAddr, port: u16) -> io::Result<Self> {
        let socket = TcpListener::bind((host, port))?;
        let address = socket.local_addr()?;
        let mut reached = address;
        if host.is_unspecified() {
            reached.set_ip(match host {
                IpAddr::V4(_) => Ipv4Addr::LOCALHOST.into(),
                IpAddr::V6(_) => Ipv6Addr::LOCALHOST.into(),
            });
        }
        let stopper = Stopper { stopped: Arc::default(), address: reached };
        Ok(Self { socket, address, stopper })
    }

    /// Address at which the server listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// A handle that stops the server.
    pub fn stopper(&self) -> Stopper {
        self.stopper.clone()
    }

    /// Responds to requests until it is stopped; returns the number of requests served.
    pub fn serve(&self, site: &dyn Site) -> u64 {
        let shared = Shared {
            site,
            stopper: &self.stopper,
            open: AtomicUsize::new(0),
            answered: AtomicU64::new(0),
        };
        std::thread::scope(|scope| {
            for stream in self.socket.incoming() {
                if self.stopper.is_stopped() {
                    break;
                }
                let Ok(stream) = stream else {
                    // Too many open files, or a client that has disconnected already: neither ends the server.
                    std::thread::sleep(Duration::from_millis(10));
                    continue;
                };
                if shared.open.fetch_add(1, Ordering::SeqCst) >= CONNECTIONS {
                    connection::refuse(stream, &shared);
                    shared.open.fetch_sub(1, Ordering::SeqCst);
                    continue;
                }
                let shared = &shared;
                let spawned = std::thread::Builder::new().spawn_scoped(scope, move || {
                    connection::attend(stream, shared);
                    shared.open.fetch_sub(1, Ordering::SeqCst);
                });
                if spawned.is_err() {
                    shared.open.fetch_sub(1, Ordering::SeqCst);
                }
            }
        });
        shared.answered.into_inner()
    }
}
