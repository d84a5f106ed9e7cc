//! UM-Bridge: requests to a server, as bytes of a connection, and responses to a client.

use std::io::{self, Read, Write};

use lacuna_um_bridge::Model;
use lacuna_um_bridge::client::read_answer;
use lacuna_um_bridge::protocol::{Config, Fault, Info, InputSizes, ModelInfo, Output, Support};
use lacuna_um_bridge::server::converse;

/// Bytes that begin with a digit are a response with that hundred of a status; others are requests.
pub fn um_bridge(bytes: &[u8]) {
    match bytes.split_first() {
        Some((hundred @ b'2'..=b'5', body)) => response(u16::from(hundred - b'0') * 100, body),
        _ => requests(bytes),
    }
}

fn response(status: u16, body: &[u8]) {
    let url = "model";
    let tell = |error: lacuna_um_bridge::client::Error| {
        let text = error.to_string();
        assert!(text.contains(url), "`{text}` does not name the server");
    };
    let _ = read_answer::<Info>(url, status, body).map_err(tell);
    let _ = read_answer::<ModelInfo>(url, status, body).map_err(tell);
    let _ = read_answer::<InputSizes>(url, status, body).map_err(tell);
    let _ = read_answer::<Output<Vec<Option<f64>>>>(url, status, body).map_err(tell);
    let _ = read_answer::<Output<Vec<Vec<Option<f64>>>>>(url, status, body).map_err(tell);
}

/// A client of which all bytes are known, and what was sent to it.
struct Wire<'a> {
    incoming: &'a [u8],
    outgoing: Vec<u8>,
}

impl Read for Wire<'_> {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        self.incoming.read(into)
    }
}

impl Write for Wire<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.outgoing.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Two inputs, of which the first has two values, and one output of three.
struct Sum;

impl Model for Sum {
    fn name(&self) -> &'static str {
        "sum"
    }

    fn support(&self) -> Support {
        Support { evaluate: true, gradient: true, apply_jacobian: true, apply_hessian: false }
    }

    fn input_sizes(&self, _: &Config) -> Result<Vec<usize>, Fault> {
        Ok(vec![2, 1])
    }

    fn output_sizes(&self, _: &Config) -> Result<Vec<usize>, Fault> {
        Ok(vec![3])
    }

    fn evaluate(&self, input: &[Vec<f64>], _: &Config) -> Result<Vec<Vec<f64>>, Fault> {
        Ok(vec![vec![input[0][0], input[0][1], input[1][0]]])
    }

    fn gradient(
        &self,
        _: usize,
        in_wrt: usize,
        input: &[Vec<f64>],
        sens: &[f64],
        _: &Config,
    ) -> Result<Vec<f64>, Fault> {
        Ok(vec![sens[2]; input[in_wrt].len()])
    }

    fn apply_jacobian(
        &self,
        _: usize,
        in_wrt: usize,
        input: &[Vec<f64>],
        vec: &[f64],
        _: &Config,
    ) -> Result<Vec<f64>, Fault> {
        Ok(vec![vec[input[in_wrt].len() - 1]; 3])
    }
}

/// Every response is whole and of a known status, and its body is JSON.
fn requests(bytes: &[u8]) {
    let mut wire = Wire { incoming: bytes, outgoing: Vec::new() };
    converse(&mut wire, &[&Sum]);
    let mut rest = &wire.outgoing[..];
    while !rest.is_empty() {
        if let Some(after) = rest.strip_prefix(b"HTTP/1.1 100 Continue\r\n\r\n") {
            rest = after;
            continue;
        }
        let end = rest.windows(4).position(|four| four == b"\r\n\r\n").expect("the end of a head");
        let head = std::str::from_utf8(&rest[..end]).expect("a head is text");
        assert!(head.starts_with("HTTP/1.1 "), "{head}");
        let length = head.lines().find_map(|line| line.strip_prefix("Content-Length: "));
        let length: usize = length.expect("a length").parse().expect("a number");
        rest = &rest[end + 4..];
        // A response to HEAD has the length of the body that it leaves out.
        if rest.len() < length || rest.starts_with(b"HTTP/1.1 ") {
            continue;
        }
        let (body, after) = rest.split_at(length);
        serde_json::from_slice::<serde_json::Value>(body).expect("a body is JSON");
        rest = after;
    }
}
