//! Command `view`: run directories in a browser on this machine.

use std::net::IpAddr;
use std::path::Path;

use lacuna::run::Stop;
use lacuna_engine::view::{Answer, ServedFolder};
use lacuna_um_bridge::http::{Body, Listener, Request, Response, Site};

use crate::{interrupt, misuse, print};

/// Address at which the pages are served.
#[derive(clap::Args)]
pub struct Place {
    /// Port (default: any free one, which is printed)
    #[arg(long, value_name = "N", default_value_t = 0, hide_default_value = true)]
    port: u16,
    /// Address of this machine to listen at; only loopback addresses are accepted
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1")]
    host: IpAddr,
}

/// Runs `lacuna view RUN|FOLDER`.
pub fn view(path: &Path, place: &Place) -> anyhow::Result<()> {
    let Place { port, host } = place;
    if !host.is_loopback() {
        return Err(misuse(format!(
            "error: `--host` is {host}, which other machines can reach\n\
             expected: a loopback address, such as 127.0.0.1\n\
             help: from another machine, `ssh -L 8000:127.0.0.1:PORT HOST` shows the pages at http://localhost:8000/"
        )));
    }
    let folder = ServedFolder::open(path).map_err(|stop| misuse(format!("error: {stop}")))?;
    let listener = Listener::bind(*host, *port).map_err(|error| {
        Stop::new(format!("cannot listen at {host}, port {port}: {error}"))
            .help("choose another port with `--port N`, or leave it out")
    })?;
    let stopper = listener.stopper();
    interrupt::when_asked(move |_| stopper.stop())
        .map_err(|error| Stop::new(format!("cannot wait for Ctrl-C: {error}")))?;
    let count = folder.names().len();
    let plural = if count == 1 { "" } else { "s" };
    print(&format!("{count} run{plural} in {}", path.display()));
    print(&format!("listening at http://{}/; Ctrl-C ends it", listener.address()));
    let answered = listener.serve(&Viewer(folder));
    print(&format!("stopped after {answered} requests"));
    Ok(())
}

/// The pages of a folder, for readers on this machine.
struct Viewer(ServedFolder);

/// True for a `Host` header that names this machine by a loopback address or as `localhost`, on any port: forwarding of ports
/// changes it. The pages of another site, whose name is made to lead here (DNS rebinding), have another one.
fn is_this_machine(host: &str) -> bool {
    let (name, port) = match host.strip_prefix('[').and_then(|rest| rest.split_once(']')) {
        Some((name, rest)) => (name, rest.strip_prefix(':').unwrap_or(rest)),
        None => host.split_once(':').unwrap_or((host, "")),
    };
    let is_loopback = name.parse::<IpAddr>().is_ok_and(|address| address.is_loopback());
    (name == "localhost" || is_loopback) && port.bytes().all(|digit| digit.is_ascii_digit())
}

/// Headers of every response: nothing is loaded from elsewhere, shown inside another page, or read by one.
fn headers() -> Vec<(&'static str, String)> {
    let policy = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; \
                  img-src 'self' data: blob:; connect-src 'self'; form-action 'self'; base-uri 'none'; \
                  frame-ancestors 'none'";
    let all = [
        ("Content-Security-Policy", policy),
        ("X-Content-Type-Options", "nosniff"),
        ("Cross-Origin-Resource-Policy", "same-origin"),
        ("Referrer-Policy", "no-referrer"),
        ("Cache-Control", "no-cache"),
    ];
    all.map(|(name, value)| (name, value.to_owned())).to_vec()
}

fn response(status: u16, kind: &'static str, body: Body) -> Response {
    Response { status, kind, headers: headers(), body }
}

fn refused(status: u16, reason: String) -> Response {
    response(status, "text/plain; charset=utf-8", Body::Bytes((reason + "\n").into_bytes()))
}

impl Site for Viewer {
    fn longest_body(&self) -> usize {
        0
    }

    fn answer(&self, request: &Request) -> Response {
        if !request.host.as_deref().is_some_and(is_this_machine) {
            let text = "the header `Host` does not name this machine: use 127.0.0.1 or localhost";
            return refused(421, text.to_owned());
        }
        if !["GET", "HEAD"].contains(&request.method.as_str()) {
            let text = format!("only GET and HEAD are answered, not {}", request.method);
            let mut response = refused(405, text);
            response.headers.push(("Allow", "GET, HEAD".to_owned()));
            return response;
        }
        match self.0.answer(&request.path, &request.query) {
            Answer::Page(text) => {
                response(200, "text/html; charset=utf-8", Body::Bytes(text.into_bytes()))
            }
            Answer::Json(text) => response(200, "application/json", Body::Bytes(text.into_bytes())),
            Answer::File { file, length, kind } => response(200, kind, Body::File(file, length)),
            Answer::MovedTo(address) => {
                let mut moved = refused(303, format!("see {address}"));
                moved.headers.push(("Location", address));
                moved
            }
            Answer::Refused(status, reason) => refused(status, reason),
        }
    }

    fn refusal(&self, status: u16, reason: String) -> Response {
        refused(status, reason)
    }
}

#[cfg(test)]
mod tests {
    use super::is_this_machine;

    #[test]
    fn only_names_of_this_machine_are_hosts() {
        for host in ["127.0.0.1", "127.0.0.1:8123", "localhost:1", "localhost", "[::1]:80", "[::1]"]
        {
            assert!(is_this_machine(host), "{host}");
        }
        for host in [
            "",
            "example.org",
            "127.0.0.1.example.org",
            "localhost.example.org:80",
            "0.0.0.0:80",
            "10.0.0.1",
            "[::2]:80",
            "127.0.0.1:80@example.org",
            "example.org:80",
            "[::1]x",
        ] {
            assert!(!is_this_machine(host), "{host}");
        }
    }
}
