//! Misbehaving servers: each responds to every connection with the same bytes.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

use std::io::{Read, Write};
use std::net::{Ipv4Addr, TcpListener};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use super::*;

/// A response with this status line and body.
fn answer(status: &str, body: &str) -> String {
    format!("HTTP/1.1 {status}\r\nContent-Length: {}\r\n\r\n{body}", body.len())
}

/// A server that responds to connections with the given bytes, one entry after the other; the last one repeatedly.
struct Script {
    url: String,
    asked: Arc<AtomicUsize>,
    heard: Arc<Mutex<Vec<u8>>>,
}

fn script(answers: Vec<String>) -> Script {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    let url = format!("http://{}", listener.local_addr().unwrap());
    let (asked, heard) = (Arc::new(AtomicUsize::new(0)), Arc::<Mutex<Vec<u8>>>::default());
    let (counted, noted) = (asked.clone(), heard.clone());
    // The thread ends with the process of the test.
    std::thread::spawn(move || {
        for stream in listener.incoming() {
            let mut stream = stream.unwrap();
            let i = counted.fetch_add(1, Ordering::SeqCst);
            let mut question = Vec::new();
            let mut chunk = [0; 4096];
            while !question.ends_with(b"}") {
                let count = stream.read(&mut chunk).unwrap();
                question.extend_from_slice(&chunk[..count]);
            }
            noted.lock().unwrap().extend(question);
            let answer = &answers[i.min(answers.len() - 1)];
            if answer == "silence" {
                std::thread::sleep(Duration::from_secs(60));
            }
            let _ = stream.write_all(answer.as_bytes());
        }
    });
    Script { url, asked, heard }
}

fn about() -> About {
    About { name: "forward".into(), config: serde_json::Map::new() }
}

fn evaluate(script: &Script, retries: u32) -> Result<Vec<Vec<f64>>, Error> {
    let client = Client::new(&script.url, Duration::from_secs(2), retries);
    client.evaluate(&about(), &[vec![1.0]])
}

/// The error message without the address, and whether it is final.
fn failure(answer: &str) -> (String, bool) {
    let script = script(vec![answer.to_owned()]);
    let error = evaluate(&script, 0).unwrap_err();
    (error.to_string().replace(&script.url, "URL"), error.is_final())
}

#[test]
fn answers_that_are_none_have_their_reasons() {
    let fault = |kind: &str| format!(r#"{{"error": {{"type": "{kind}", "message": "no"}}}}"#);
    let whole = answer("200 OK", r#"{"output": [[1.0]]}"#);
    let useless = "the answer of the server at URL cannot be used: ";
    let cases = [
        (
            answer("200 OK", r#"{"output": [[1.0, NaN]]}"#),
            format!("{useless}value 1 of output vector 0 is not a finite number"),
            false,
        ),
        (
            answer("200 OK", r#"{"output": [[1.0], [-inf]]}"#),
            format!("{useless}value 0 of output vector 1 is not a finite number"),
            false,
        ),
        (
            answer("400 Bad Request", &fault("InvalidInput")),
            "the server at URL reports InvalidInput: no".to_owned(),
            false,
        ),
        (
            answer("400 Bad Request", &fault("ModelNotFound")),
            "the server at URL reports ModelNotFound: no".to_owned(),
            true,
        ),
        (
            answer("200 OK", "<html>\n</html>"),
            format!("{useless}expected value at line 1 column 1: `<html>`"),
            false,
        ),
        (
            answer("200 OK", r#"{"output": 3.0}"#),
            format!(
                "{useless}invalid type: floating point `3.0`, expected a sequence at line 1 column 14: \
                 `{{\"output\": 3.0}}`"
            ),
            false,
        ),
        (
            answer("500 Internal Server Error", "Traceback\nmore of this"),
            format!("{useless}HTTP status 500: `Traceback`"),
            false,
        ),
        (
            answer("404 Not Found", ""),
            "the server at URL does not speak UM-Bridge: it answered 404".to_owned(),
            true,
        ),
        (
            answer("503 Service Unavailable", "busy"),
            "no server at URL: HTTP status 503: `busy`".to_owned(),
            true,
        ),
        (
            "HTTP/1.1 302 Found\r\nLocation: http://elsewhere/Evaluate\r\nContent-Length: 0\r\n\r\n"
                .to_owned(),
            "the server at URL refers to `http://elsewhere/Evaluate`: write the address of the \
             server itself"
                .to_owned(),
            true,
        ),
        (
            whole[..whole.len() - 3].to_owned(),
            "the server at URL broke the connection: the answer breaks off before its end"
                .to_owned(),
            false,
        ),
        (
            String::new(),
            "the server at URL broke the connection: it closed it without an answer".to_owned(),
            false,
        ),
    ];
    for (answer, message, is_final) in cases {
        assert_eq!(failure(&answer), (message, is_final), "{answer}");
    }
}

#[test]
fn a_slow_server_is_not_waited_for_and_not_asked_again() {
    let script = script(vec!["silence".to_owned()]);
    let begun = Instant::now();
    let error = evaluate(&script, 3).unwrap_err();
    assert!(begun.elapsed() < Duration::from_secs(30), "the server is silent for 60 s");
    assert_eq!(
        error.to_string(),
        format!("the server at {} has not answered within 2 s", script.url)
    );
    assert!(!error.is_final());
    assert_eq!(script.asked.load(Ordering::SeqCst), 1);
}

#[test]
fn a_broken_connection_is_tried_again() {
    let good = answer("200 OK", r#"{"output":[[2.5]]}"#);
    let script = script(vec![String::new(), answer("503 Busy", ""), good]);
    assert_eq!(evaluate(&script, 2).unwrap(), [[2.5]]);
    assert_eq!(script.asked.load(Ordering::SeqCst), 3);
    let heard = String::from_utf8(script.heard.lock().unwrap().clone()).unwrap();
    let question = r#"{"name":"forward","input":[[1.0]],"config":{}}"#;
    assert_eq!(heard.matches(question).count(), 3, "{heard}");
}

#[test]
fn nobody_is_there() {
    let free = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    let url = format!("http://{}", free.local_addr().unwrap());
    drop(free);
    let client = Client::new(&format!("{url}/"), Duration::from_secs(2), 1);
    let begun = Instant::now();
    let error = client.info().unwrap_err();
    assert!(begun.elapsed() > Duration::from_millis(200), "one pause before the second attempt");
    assert_eq!(error.to_string(), format!("no server at {url}: the connection is refused"));
    assert!(error.is_final());
    let client = Client::new("here and there", Duration::from_secs(2), 0);
    assert!(client.info().unwrap_err().is_final());
}
