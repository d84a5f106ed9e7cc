#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

use std::io::{Read, Write};
use std::net::{Ipv4Addr, TcpStream};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use super::*;
use crate::Client;
use crate::client::Place;
use crate::protocol::{About, Config, Support};

/// Maps vectors `a` (of `size` values) and `[b]` to `b a²` elementwise and `[b³]`.
struct Powers {
    running: AtomicUsize,
    most: AtomicUsize,
}

impl Powers {
    fn new() -> Self {
        Self { running: AtomicUsize::new(0), most: AtomicUsize::new(0) }
    }
}

fn size(config: &Config) -> usize {
    config.get("size").and_then(serde_json::Value::as_u64).unwrap_or(2) as usize
}

impl Model for Powers {
    fn name(&self) -> &'static str {
        "powers"
    }
    fn support(&self) -> Support {
        Support { evaluate: true, gradient: true, apply_jacobian: true, apply_hessian: true }
    }
    fn input_sizes(&self, config: &Config) -> Result<Vec<usize>, Fault> {
        Ok(vec![size(config), 1])
    }
    fn output_sizes(&self, config: &Config) -> Result<Vec<usize>, Fault> {
        Ok(vec![size(config), 1])
    }
    fn evaluate(&self, input: &[Vec<f64>], _: &Config) -> Result<Vec<Vec<f64>>, Fault> {
        let (a, b) = (&input[0], input[1][0]);
        let running = self.running.fetch_add(1, Ordering::SeqCst) + 1;
        self.most.fetch_max(running, Ordering::SeqCst);
        if b == -2.0 {
            std::thread::sleep(Duration::from_millis(50));
        }
        self.running.fetch_sub(1, Ordering::SeqCst);
        assert!(b != -1.0, "asked to panic");
        if b == -3.0 {
            return Ok(vec![vec![1.0]]);
        }
        Ok(vec![a.iter().map(|a| b * a * a).collect(), vec![b * b * b]])
    }
    fn gradient(
        &self,
        out_wrt: usize,
        in_wrt: usize,
        input: &[Vec<f64>],
        sens: &[f64],
        _: &Config,
    ) -> Result<Vec<f64>, Fault> {
        let (a, b) = (&input[0], input[1][0]);
        Ok(match (out_wrt, in_wrt) {
            (0, 0) => a.iter().zip(sens).map(|(a, s)| 2.0 * a * b * s).collect(),
            (0, _) => vec![a.iter().zip(sens).map(|(a, s)| a * a * s).sum()],
            (_, 0) => vec![0.0; a.len()],
            _ => vec![3.0 * b * b * sens[0]],
        })
    }
    fn apply_jacobian(
        &self,
        _: usize,
        _: usize,
        input: &[Vec<f64>],
        vec: &[f64],
        _: &Config,
    ) -> Result<Vec<f64>, Fault> {
        Ok(input[0].iter().zip(vec).map(|(a, v)| 2.0 * a * input[1][0] * v).collect())
    }
    fn apply_hessian(
        &self,
        _: usize,
        _: [usize; 2],
        input: &[Vec<f64>],
        sens: &[f64],
        vec: &[f64],
        _: &Config,
    ) -> Result<Vec<f64>, Fault> {
        let each = sens.iter().zip(vec);
        Ok(each.map(|(s, v)| 2.0 * input[1][0] * s * v).collect())
    }
}

/// A model that supports only evaluation and always returns NaN.
struct Bare;

impl Model for Bare {
    fn name(&self) -> &'static str {
        "bare"
    }
    fn support(&self) -> Support {
        Support { evaluate: true, ..Support::default() }
    }
    fn input_sizes(&self, _: &Config) -> Result<Vec<usize>, Fault> {
        Ok(vec![1])
    }
    fn output_sizes(&self, _: &Config) -> Result<Vec<usize>, Fault> {
        Ok(vec![1])
    }
    fn evaluate(&self, _: &[Vec<f64>], _: &Config) -> Result<Vec<Vec<f64>>, Fault> {
        Ok(vec![vec![f64::NAN]])
    }
}

/// Runs a server while `ask` runs; returns the number of requests served.
fn serving(models: &[&dyn Model], at_a_time: usize, ask: impl FnOnce(SocketAddr)) -> u64 {
    let server = Server::bind(Ipv4Addr::LOCALHOST.into(), 0).unwrap();
    std::thread::scope(|scope| {
        let served = scope.spawn(|| server.serve(models, at_a_time));
        let outcome = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
            ask(server.address());
        }));
        server.stopper().stop();
        let answered = served.join().unwrap();
        outcome.unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        answered
    })
}

fn client(address: SocketAddr) -> Client {
    Client::new(&format!("http://{address}"), Duration::from_secs(10), 0)
}

fn about(name: &str, config: serde_json::Value) -> About {
    About { name: name.to_owned(), config: serde_json::from_value(config).unwrap() }
}

#[test]
fn the_client_gets_what_the_model_gives() {
    let powers = Powers::new();
    let answered = serving(&[&powers, &Bare], 2, |address| {
        let client = client(address);
        let info = client.info().unwrap();
        assert_eq!(
            (info.protocol_version, info.models),
            (1.0, vec!["powers".into(), "bare".into()])
        );
        let two = about("powers", serde_json::json!({}));
        let three = about("powers", serde_json::json!({"size": 3}));
        assert_eq!(client.input_sizes(&two).unwrap(), [2, 1]);
        assert_eq!(client.output_sizes(&three).unwrap(), [3, 1]);
        assert!(client.support(&two).unwrap().apply_hessian);
        // Numbers are transmitted bit for bit.
        let x = [0.1 + 0.2, 1e-300];
        let input = [x.to_vec(), vec![3.0]];
        let expected = [vec![3.0 * x[0] * x[0], 3.0 * x[1] * x[1]], vec![27.0]];
        assert_eq!(client.evaluate(&two, &input).unwrap(), expected);
        let at = |output, input| Place { output, input };
        let sens = [1.0, 10.0];
        let gradient = client.gradient(&two, at(0, 1), &input, &sens).unwrap();
        assert_eq!(gradient, [x[0] * x[0] + 10.0 * x[1] * x[1]]);
        let along = client.apply_jacobian(&two, at(0, 0), &input, &[1.0, 0.0]).unwrap();
        assert_eq!(along, [6.0 * x[0], 0.0]);
        let second = client.apply_hessian(&two, at(0, 0), 0, &input, &sens, &[2.0, 0.0]).unwrap();
        assert_eq!(second, [12.0, 0.0]);
    });
    assert_eq!(answered, 8);
}

#[test]
fn wrong_questions_get_error_bodies() {
    let powers = Powers::new();
    serving(&[&powers, &Bare], 1, |address| {
        let client = client(address);
        let says = |error: crate::client::Error| {
            error.to_string().replace(&format!("the server at http://{address} reports "), "")
        };
        let evaluate = |name: &str, input: &[Vec<f64>]| {
            says(client.evaluate(&about(name, serde_json::json!({})), input).unwrap_err())
        };
        assert_eq!(
            evaluate("power", &[]),
            "ModelNotFound: there is no model `power`; there are `powers`, `bare`"
        );
        assert_eq!(
            evaluate("powers", &[vec![1.0], vec![1.0]]),
            "InvalidInput: the inputs have the sizes [1, 1], expected [2, 1]"
        );
        assert_eq!(evaluate("bare", &[vec![1.0]]), "InvalidOutput: value 0 is NaN");
        let with = |b: f64| [vec![1.0, 2.0], vec![b]];
        assert_eq!(evaluate("powers", &with(-1.0)), "InternalError: the model panicked");
        assert_eq!(
            evaluate("powers", &with(-3.0)),
            "InvalidOutput: the outputs have the sizes [1], not [2, 1]"
        );
        let (powers, bare) =
            (about("powers", serde_json::json!({})), about("bare", serde_json::json!({})));
        let at = Place { output: 0, input: 2 };
        assert_eq!(
            says(client.gradient(&powers, at, &with(1.0), &[1.0, 1.0]).unwrap_err()),
            "InvalidInput: `inWrt` is 2, expected less than 2"
        );
        let at = Place { output: 0, input: 0 };
        assert_eq!(
            says(client.gradient(&powers, at, &with(1.0), &[1.0]).unwrap_err()),
            "InvalidInput: `sens` has the size 1, expected 2"
        );
        assert_eq!(
            says(client.apply_jacobian(&bare, at, &[vec![1.0]], &[1.0]).unwrap_err()),
            "UnsupportedFeature: the model `bare` does not support ApplyJacobian"
        );
        // The place of the model that panicked is free again.
        assert!(client.evaluate(&powers, &with(1.0)).is_ok());
    });
}

/// The response to raw bytes, until the server closes the connection or stays silent.
fn raw(address: SocketAddr, bytes: &[u8]) -> String {
    let mut stream = TcpStream::connect(address).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(1))).unwrap();
    stream.write_all(bytes).unwrap();
    let mut answer = Vec::new();
    let _ = stream.read_to_end(&mut answer);
    String::from_utf8(answer).unwrap()
}

#[test]
fn what_is_no_question_is_refused_without_harm() {
    serving(&[&Bare], 1, |address| {
        let post = |path: &str, body: &str| {
            let length = body.len();
            raw(
                address,
                format!("POST {path} HTTP/1.1\r\nConnection: close\r\nContent-Length: {length}\r\n\r\n{body}")
                    .as_bytes(),
            )
        };
        let cases = [
            (raw(address, b"hello\r\n\r\n"), "HTTP/1.1 400", "this is no HTTP"),
            (raw(address, &vec![b'A'; 20_000]), "HTTP/1.1 431", "too long"),
            (
                raw(address, b"GET /nothing HTTP/1.0\r\n\r\n"),
                "HTTP/1.1 404",
                "there is no `/nothing`",
            ),
            (raw(address, b"GET /Evaluate HTTP/1.0\r\n\r\n"), "HTTP/1.1 405", "with POST, not GET"),
            (
                raw(address, b"POST /Evaluate HTTP/1.1\r\nContent-Length: 1e3\r\n\r\n"),
                "HTTP/1.1 400",
                "`Content-Length` is `1e3`",
            ),
            (
                raw(address, b"POST /Evaluate HTTP/1.1\r\nContent-Length: +2\r\n\r\n{}"),
                "HTTP/1.1 400",
                "`Content-Length` is `+2`",
            ),
            (
                raw(address, b"POST /Evaluate HTTP/1.1\r\nContent-Length: 999999999999\r\n\r\n"),
                "HTTP/1.1 413",
                "too long",
            ),
            (
                raw(
                    address,
                    b"POST /Evaluate HTTP/1.1\r\nContent-Length: 2\r\nContent-Length: 9\r\n\r\n{}",
                ),
                "HTTP/1.1 400",
                "more than one `Content-Length`",
            ),
            (
                raw(
                    address,
                    b"POST /Evaluate HTTP/1.1\r\nOrigin: http://example.org\r\nContent-Length: 2\r\n\r\n{}",
                ),
                "HTTP/1.1 403",
                "questions of web pages",
            ),
            (
                raw(address, b"POST /Evaluate HTTP/1.1\r\nTransfer-Encoding: chunked\r\n\r\n"),
                "HTTP/1.1 411",
                "Content-Length",
            ),
            (post("/Evaluate", "{\"name\": \"bare\", \"input\": [[1.0"), "HTTP/1.1 400", "EOF"),
            (
                post("/Evaluate", "{\"name\": \"bare\", \"input\": [[NaN]]}"),
                "HTTP/1.1 400",
                "does not read",
            ),
            (
                post("/Gradient", "{\"name\": \"bare\", \"outWrt\": -1}"),
                "HTTP/1.1 400",
                "does not read",
            ),
        ];
        for (answer, status, word) in &cases {
            assert!(answer.starts_with(status), "{answer}");
            assert!(answer.contains("\"error\":{\"type\":\"InvalidInput\""), "{answer}");
            assert!(answer.contains(word), "{answer}");
        }
        // An incomplete request gets no response and does no harm.
        assert_eq!(raw(address, b"POST /Evaluate HTTP/1.1\r\nContent-Length: 9\r\n\r\nhalf"), "");
        assert!(raw(address, b"GET /Info HTTP/1.1\r\n\r\n").contains("\"models\":[\"bare\"]"));
    });
}

#[test]
fn a_connection_stays_for_more_questions() {
    serving(&[&Bare], 1, |address| {
        let one = "GET /Info HTTP/1.1\r\n\r\n";
        let three = raw(address, one.repeat(3).as_bytes());
        assert_eq!(three.matches("HTTP/1.1 200 OK").count(), 3, "{three}");
        let closed = raw(
            address,
            format!("{}{one}", one.replace("\r\n\r\n", "\r\nConnection: close\r\n\r\n")).as_bytes(),
        );
        assert_eq!(closed.matches("HTTP/1.1 200 OK").count(), 1, "{closed}");
        let old = raw(address, format!("GET /Info HTTP/1.0\r\n\r\n{one}").as_bytes());
        assert_eq!(old.matches("200 OK").count(), 1, "{old}");
        let waits =
            "POST /ModelInfo HTTP/1.1\r\nExpect: 100-continue\r\nContent-Length: 15\r\n\r\n";
        let mut stream = TcpStream::connect(address).unwrap();
        stream.write_all(waits.as_bytes()).unwrap();
        let mut word = [0; 25];
        stream.read_exact(&mut word).unwrap();
        assert_eq!(&word, b"HTTP/1.1 100 Continue\r\n\r\n");
    });
}

#[test]
fn so_many_evaluations_run_at_a_time_and_no_more() {
    let powers = Powers::new();
    serving(&[&powers], 2, |address| {
        let client = client(address);
        let slow = || {
            let input = [vec![1.0, 1.0], vec![-2.0]];
            client.evaluate(&about("powers", serde_json::json!({})), &input).unwrap();
        };
        std::thread::scope(|scope| {
            for _ in 0..6 {
                scope.spawn(slow);
            }
        });
    });
    assert_eq!(powers.most.load(Ordering::SeqCst), 2);
}

#[test]
fn a_server_stops_when_it_is_told_though_clients_stay() {
    let begun = Instant::now();
    let mut stays = None;
    serving(&[&Bare], 1, |address| {
        let mut stream = TcpStream::connect(address).unwrap();
        stream.write_all(b"GET /Info HTTP/1.1\r\n\r\n").unwrap();
        let mut first = [0; 12];
        stream.read_exact(&mut first).unwrap();
        stays = Some(stream);
    });
    assert!(begun.elapsed() < Duration::from_secs(20), "{:?}", begun.elapsed());
}
