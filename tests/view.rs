//! `lacuna view`: its pages and JSON over HTTP, and requests that it refuses.

use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{Ipv4Addr, TcpStream};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::{browser, quick};

/// `lacuna view` at a free port.
struct Viewed {
    child: Child,
    port: u16,
}

/// A response: status, head and body.
struct Received {
    status: u16,
    head: String,
    body: String,
}

impl Viewed {
    fn start(folder: &Path, arguments: &[&str]) -> Self {
        let mut command = quick::command();
        command.arg("view").arg(folder).args(arguments).stdout(Stdio::piped());
        let mut child = command.spawn().unwrap();
        let mut lines = BufReader::new(child.stdout.as_mut().unwrap()).lines();
        let line = lines.find(|line| line.as_ref().unwrap().starts_with("listening at ")).unwrap();
        let line = line.unwrap();
        let port = line.strip_prefix("listening at http://127.0.0.1:").unwrap();
        let port = port.split('/').next().unwrap().parse().unwrap();
        Self { child, port }
    }

    /// The response to a request as it is.
    fn raw(&self, request: &str) -> Received {
        let mut stream = TcpStream::connect((Ipv4Addr::LOCALHOST, self.port)).unwrap();
        stream.write_all(request.as_bytes()).unwrap();
        let mut bytes = Vec::new();
        stream.read_to_end(&mut bytes).unwrap();
        let text = String::from_utf8_lossy(&bytes);
        let (head, body) = text.split_once("\r\n\r\n").unwrap_or_else(|| panic!("{text}"));
        let status = head.split(' ').nth(1).unwrap().parse().unwrap();
        Received { status, head: head.to_owned(), body: body.to_owned() }
    }

    fn asked(&self, method: &str, path: &str) -> Received {
        let port = self.port;
        self.raw(&format!(
            "{method} {path} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nConnection: close\r\n\r\n"
        ))
    }

    fn get(&self, path: &str) -> String {
        let received = self.asked("GET", path);
        assert_eq!(received.status, 200, "{path}: {}", received.body);
        received.body
    }

    fn json(&self, path: &str) -> Value {
        serde_json::from_str(&self.get(path)).unwrap()
    }

    /// Sends Ctrl-C and returns the exit code.
    fn interrupt(mut self) -> Option<i32> {
        let id = self.child.id().to_string();
        assert!(Command::new("kill").args(["-INT", &id]).status().unwrap().success());
        self.child.wait().unwrap().code()
    }
}

impl Drop for Viewed {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Finished runs of the study that `lacuna new study` writes, with two surrogates, in `runs`.
fn two_runs(folder: &Path) {
    for degree in [5, 6] {
        let out = folder.join(format!("runs/degree {degree}"));
        let settings = ["sampler.steps=100", &format!("surrogate.degree={degree}")];
        let ran = quick::run(&folder.join("study.toml"), &settings, &out);
        ran.unwrap_or_else(|stop| panic!("{stop}"));
        assert!(!out.join("progress.json").exists());
    }
}

/// Names, lengths and times of all files.
fn listing(folder: &Path) -> Vec<String> {
    let mut found = Vec::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).unwrap() {
            let (path, about) = entry.map(|e| (e.path(), e.metadata().unwrap())).unwrap();
            let time = about.modified().unwrap();
            found.push(format!("{} {} {time:?}", path.display(), about.len()));
            if about.is_dir() {
                folders.push(path);
            }
        }
    }
    found.sort();
    found
}

#[test]
fn finished_runs_are_listed_shown_and_compared() {
    let folder = quick::tables();
    two_runs(folder.path());
    let runs = folder.path().join("runs");
    let before = listing(&runs);
    let viewed = Viewed::start(&runs, &[]);

    let all = viewed.json("/api/runs");
    assert_eq!(all["schema"], 1);
    let first = &all["runs"][0];
    assert_eq!((&first["name"], &first["state"]), (&Value::from("degree 5"), &"finished".into()));
    let summary = quick::summary(&runs.join("degree 5"));
    assert_eq!(first["level"], summary["assessment"]["level"]);
    assert_eq!(first["parameters"][0]["mean"], summary["parameters"]["frequency"]["mean"]);
    let list = viewed.get("/");
    for part in ["href=\"/runs/degree%206/\"", "finished", "frequency ", "name=\"run\""] {
        assert!(list.contains(part), "no {part} in {list}");
    }

    let run = viewed.get("/runs/degree%205/");
    for part in ["href=\"report.html\"", "figures/traces.svg", "4-surrogate", "class=\"assessment"]
    {
        assert!(run.contains(part), "no {part} in {run}");
    }
    let report = viewed.get("/runs/degree%205/report.html");
    assert_eq!(report, fs::read_to_string(runs.join("degree 5/report.html")).unwrap());
    let figure = viewed.asked("GET", "/runs/degree%205/figures/traces.svg");
    assert!(figure.head.contains("Content-Type: image/svg+xml\r\n"), "{}", figure.head);
    assert!(
        figure.head.contains("Content-Security-Policy: default-src 'none';"),
        "{}",
        figure.head
    );
    let head = viewed.asked("HEAD", "/runs/degree%205/report.html");
    assert!(
        head.body.is_empty() && head.head.contains(&format!("Content-Length: {}", report.len()))
    );
    let moved = viewed.asked("GET", "/runs/degree%205");
    assert!(moved.status == 303 && moved.head.contains("Location: /runs/degree%205/"));

    // The comparison is that of the command.
    let query = "run=degree+5&run=degree%206";
    let compared = viewed.json(&format!("/api/compare?{query}"));
    let mut command = quick::command();
    command.arg("compare").args(["degree 5", "degree 6"]).arg("--json").current_dir(&runs);
    let expected: Value = serde_json::from_slice(&command.output().unwrap().stdout).unwrap();
    assert_eq!(compared, expected);
    let page = viewed.get(&format!("/compare?{query}"));
    assert!(
        page.contains("Evidence and prediction") && page.contains("weight by stacking"),
        "{page}"
    );
    for (query, status) in [("run=degree+5", 400), ("run=degree+5&run=degree+7", 404)] {
        assert_eq!(viewed.asked("GET", &format!("/compare?{query}")).status, status, "{query}");
    }
    assert_eq!(viewed.interrupt(), Some(0));
    assert_eq!(listing(&runs), before);
}

#[test]
fn what_leads_out_of_the_folder_or_is_no_question_is_refused() {
    let folder = quick::tables();
    two_runs(folder.path());
    fs::write(folder.path().join("secret.txt"), "secret").unwrap();
    let runs = folder.path().join("runs");
    let viewed = Viewed::start(&runs, &[]);
    for path in [
        "/runs/degree%205/../../secret.txt",
        "/runs/../secret.txt",
        "/runs/%2e%2e/secret.txt",
        "/runs/degree%205/..%2f..%2fsecret.txt",
        "/runs/degree%205/%2e%2e/%2e%2e/secret.txt",
        "/../secret.txt",
        "//secret.txt",
        "/runs/degree%205/.lock",
        "http://127.0.0.1/runs/degree%205/summary.json",
    ] {
        let received = viewed.asked("GET", path);
        assert_eq!(received.status, 403, "{path}: {}", received.body);
    }
    for path in
        ["/secret.txt", "/runs/degree%205/none.txt", "/runs/none/", "/api/runs/none", "/api"]
    {
        assert_eq!(viewed.asked("GET", path).status, 404, "{path}");
    }
    for method in ["POST", "PUT", "DELETE", "OPTIONS", "TRACE"] {
        let received = viewed.asked(method, "/api/runs");
        assert!(received.status == 405 && received.head.contains("Allow: GET, HEAD"), "{method}");
    }
    let ask = |head: &str| {
        viewed.raw(&format!("GET /api/runs HTTP/1.1\r\n{head}Connection: close\r\n\r\n"))
    };
    // A name of another site that leads to this machine, none, and two.
    for head in ["Host: example.org\r\n", "", "Host: localhost\r\nHost: example.org\r\n"] {
        assert_eq!(ask(head).status, 421, "{head}");
    }
    assert_eq!(ask("Host: localhost:9\r\n").status, 200);
    assert_eq!(ask("Host: localhost\r\nContent-Length: 10\r\n").status, 413);
    assert_eq!(ask(&format!("Host: localhost\r\nX: {}\r\n", "x".repeat(20_000))).status, 431);
    assert_eq!(viewed.raw("nonsense\r\n\r\n").status, 400);

    let refused = |arguments: &[&str]| quick::said(quick::command().arg("view").args(arguments));
    let (code, text) = refused(&[&runs.display().to_string(), "--host", "0.0.0.0"]);
    assert!(code == Some(2) && text.contains("expected: a loopback address"), "{text}");
    let (code, text) = refused(&[&folder.path().join("none").display().to_string()]);
    assert!(code == Some(2) && text.contains("help: give a run directory"), "{text}");
    let (code, text) = refused(&[&runs.display().to_string(), "--port", &viewed.port.to_string()]);
    assert!(code == Some(1) && text.contains("choose another port"), "{text}");
}

/// Asks for a run until something is true of it.
fn wait(viewed: &Viewed, path: &str, what: &str, is: impl Fn(&Value) -> bool) -> Value {
    let begun = Instant::now();
    loop {
        let found = viewed.asked("GET", path);
        if found.status == 200 {
            let found: Value = serde_json::from_str(&found.body).unwrap();
            if is(&found) {
                return found;
            }
        }
        assert!(begun.elapsed() < Duration::from_secs(120), "{what}: {}", found.body);
        std::thread::sleep(Duration::from_millis(50));
    }
}

#[test]
fn a_run_is_followed_from_its_first_runs_to_its_report() {
    let folder = quick::simulated();
    let out = folder.path().join("runs/live");
    fs::create_dir(folder.path().join("runs")).unwrap();
    let viewed = Viewed::start(&folder.path().join("runs"), &[]);
    assert!(viewed.get("/").contains("There are no runs here yet"));
    let settings = [
        "model.numerics.mesh=\"default\"",
        "sampler.walkers=60",
        "sampler.steps=9000",
        "surrogate.degree=3",
        "validate.emulator_check=0",
    ];
    let mut command = quick::command();
    command
        .args(["run", "--threads", "1", "--out"])
        .arg(&out)
        .arg(folder.path().join("study.toml"));
    command.args(settings.iter().flat_map(|setting| ["--set", setting]));
    let mut child = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();

    let is = |found: &Value, key: &str| found[key].is_object();
    let simulating = wait(&viewed, "/api/runs/live", "runs", |found| {
        found["campaign"]["counts"][0]["done"].as_u64().is_some_and(|done| done > 0)
    });
    assert_eq!(simulating["campaign"]["counts"][0]["runs"], 40);
    assert_eq!(simulating["state"], "running");

    let sampling = wait(&viewed, "/api/runs/live", "a diagnosis", |found| {
        is(found, "sampling") && found["sampling"]["coordinates"][0]["r_hat"].is_number()
    });
    assert_eq!((&sampling["state"], &sampling["stage"]), (&"running".into(), &"calibrate".into()));
    assert_eq!(sampling["progress"]["total"], 9000);
    let chains = &sampling["sampling"];
    assert_eq!((&chains["chains"], &chains["planned"]), (&60.into(), &9000.into()));
    assert_eq!(chains["coordinates"][3]["scale"], "logarithmic");
    let page = viewed.get("/runs/live/");
    assert!(page.contains("<progress max=\"9000\"") && page.contains("R-hat"), "{page}");
    let part = viewed.get("/part/runs/live");
    assert!(part.contains("class=\"drawings\"") && !part.contains("<html"), "{part}");
    // Who looks at a run does not take it over.
    assert_eq!(quick::said(quick::command().arg("resume").arg(&out)).0, Some(1));

    let done = wait(&viewed, "/api/runs/live", "the end", |found| found["state"] == "finished");
    assert!(child.wait().unwrap().success());
    assert!(done["sampling"].is_null() && done["progress"].is_null());
    let summary = quick::summary(&out);
    assert_eq!(done["parameters"][0]["sd"], summary["parameters"]["tensile_cutoff"]["sd"]);
    assert!(done["files"].as_array().unwrap().contains(&"report.html".into()));
    assert_eq!(viewed.interrupt(), Some(0));

    // One run by itself; its address is that of the page.
    let viewed = Viewed::start(&out, &["--port", "0"]);
    let moved = viewed.asked("GET", "/");
    assert!(moved.status == 303 && moved.head.contains("Location: /runs/live/"), "{}", moved.head);
    assert!(!viewed.get("/runs/live/").contains("All runs"));
}

#[test]
fn an_interrupted_run_tells_where_it_stopped() {
    let folder = quick::simulated();
    let out = folder.path().join("run");
    let settings = ["sampler.walkers=60", "sampler.steps=100000", "surrogate.degree=3"];
    let mut command = quick::command();
    command
        .args(["run", "--threads", "1", "--out"])
        .arg(&out)
        .arg(folder.path().join("study.toml"));
    command.args(settings.iter().flat_map(|setting| ["--set", setting]));
    let mut child = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let begun = Instant::now();
    while !out.join("5-calibrate/state.json").exists() {
        assert!(begun.elapsed() < Duration::from_secs(120), "the sampler does not begin");
        std::thread::sleep(Duration::from_millis(20));
    }
    let viewed = Viewed::start(&out, &[]);
    child.kill().unwrap();
    child.wait().unwrap();
    let stopped = wait(&viewed, "/api/runs/run", "the kill", |found| found["state"] == "stopped");
    assert_eq!(stopped["stage"], "calibrate");
    assert!(stopped["sampling"]["steps"].as_u64().unwrap() > 0, "{stopped}");
    assert!(stopped["verdict"].is_null() && stopped["level"].is_null());
    for view in browser::VIEWS {
        let page = viewed.get("/runs/run/");
        let Some(wrong) = browser::wrong_in(&page, view, folder.path()) else { return };
        // The tools of figures are those of the report.
        let kinds = [": no SVG", ": no PNG", ": no CSV"];
        let wrong: Vec<&String> =
            wrong.iter().filter(|text| kinds.iter().all(|kind| !text.ends_with(kind))).collect();
        assert!(wrong.is_empty(), "{view:?}: {wrong:#?}");
    }
}
