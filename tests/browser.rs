//! The report in a browser: no errors, no overflow, every figure drawn and named, letters and contrast that can be read, the
//! tools that explore it, and its pages on paper.
//!
//! Needs `chromium`; without it the test says that it is left out. `LACUNA_AXE` may name the file `axe.min.js` of the package
//! axe-core, whose rules of accessibility are then checked too.

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::quick;

/// Script that checks a report inside its page.
const CHECKS: &str = include_str!("browser/checks.js");

/// Width of the window in pixels, and colours.
pub const VIEWS: [(u32, &str); 4] =
    [(360, "light"), (1280, "light"), (1280, "dark"), (360, "dark")];

/// Starts of a browser that hangs, which it does now and then where many processes are at work, and the time of each.
const STARTS: usize = 4;
const PATIENCE: Duration = Duration::from_secs(60);

/// Output and messages of the browser; `None` if there is none.
fn chromium(folder: &Path, arguments: &[String]) -> Option<(String, String)> {
    let (out, err) = (folder.join("stdout"), folder.join("stderr"));
    let read = |path: &Path| String::from_utf8_lossy(&fs::read(path).unwrap()).into_owned();
    for start in 0..STARTS {
        let mut browser = Command::new("chromium");
        browser
            .args(["--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"])
            .args(["--allow-file-access-from-files", "--enable-logging=stderr"])
            .arg("--window-size=1400,2000")
            .arg(format!("--user-data-dir={}", folder.join(format!("profile{start}")).display()))
            .args(arguments)
            .stdout(fs::File::create(&out).unwrap())
            .stderr(fs::File::create(&err).unwrap())
            .stdin(Stdio::null());
        let mut running = browser.spawn().ok()?;
        let begin = Instant::now();
        while running.try_wait().unwrap().is_none() && begin.elapsed() < PATIENCE {
            std::thread::sleep(Duration::from_millis(50));
        }
        if running.try_wait().unwrap().is_some() {
            return Some((read(&out), read(&err)));
        }
        running.kill().unwrap();
        running.wait().unwrap();
    }
    panic!("chromium did not end in any of {STARTS} starts: {}", read(&err));
}

/// The report with the checks, in a frame of this width.
fn framed(page: &str, (width, theme): (u32, &str), folder: &Path) -> String {
    let axe = std::env::var_os("LACUNA_AXE").map(|path| fs::read_to_string(path).unwrap());
    let axe = axe.unwrap_or_default().replace("</script", "<\\/script");
    let page =
        page.replace("<html lang=\"en\">", &format!("<html lang=\"en\" data-theme=\"{theme}\">"));
    let (before, after) = page.rsplit_once("</body>").unwrap();
    let scripts = format!("<script>{axe}</script><script>{CHECKS}</script>");
    fs::write(folder.join("in.html"), format!("{before}{scripts}</body>{after}")).unwrap();
    let frame = format!(
        "<!DOCTYPE html><title>frame</title><iframe src=\"in.html\" style=\"width:{width}px;height:1800px;border:0\"></iframe>\
         <pre id=\"told\"></pre><script>onmessage = (e) => {{ document.getElementById(\"told\").textContent = e.data; }};</script>"
    );
    fs::write(folder.join("frame.html"), frame).unwrap();
    format!("file://{}", folder.join("frame.html").display())
}

/// Findings of the checks.
fn told(dom: &str) -> Value {
    let (_, rest) =
        dom.split_once("<pre id=\"told\">").unwrap_or_else(|| panic!("no result in {dom}"));
    let text = rest.split_once("</pre>").unwrap().0;
    let text = text
        .replace("&lt;", "<")
        .replace("&gt;", ">")
        .replace("&quot;", "\"")
        .replace("&amp;", "&");
    serde_json::from_str(&text).unwrap_or_else(|error| panic!("{error}: `{text}`"))
}

/// Findings of the checks in a page; `None` without a browser.
pub fn wrong_in(page: &str, view: (u32, &str), folder: &Path) -> Option<Vec<String>> {
    let address = framed(page, view, folder);
    let arguments = ["--virtual-time-budget=15000", "--dump-dom", address.as_str()];
    let (dom, _) = chromium(folder, &arguments.map(str::to_owned))?;
    let told = told(&dom);
    let text = |wrong: &Value| wrong.as_str().unwrap().to_owned();
    Some(told["wrong"].as_array().unwrap().iter().map(text).collect())
}

#[test]
fn the_report_works_in_a_browser() {
    let folder = quick::simulated();
    let out = folder.path().join("run");
    let ran = quick::run(&folder.path().join("study.toml"), &[], &out);
    ran.unwrap_or_else(|stop| panic!("{stop}"));
    let page = fs::read_to_string(out.join("report.html")).unwrap();
    assert!(page.len() < 3_000_000, "{} bytes", page.len());
    for view in VIEWS {
        let address = framed(&page, view, folder.path());
        let arguments = ["--virtual-time-budget=15000", "--dump-dom", address.as_str()];
        let Some((dom, messages)) = chromium(folder.path(), &arguments.map(str::to_owned)) else {
            println!("left out: there is no `chromium`");
            return;
        };
        let messages: Vec<&str> =
            messages.lines().filter(|line| line.contains("CONSOLE")).collect();
        assert!(messages.is_empty(), "{view:?}: {messages:#?}");
        let told = told(&dom);
        println!(
            "{view:?}: {} figures, smallest letters {} px, axe: {}",
            told["figures"], told["letters"], told["axe"]
        );
        assert_eq!(told["wrong"], Value::Array(Vec::new()), "{view:?}: {told:#}");
        assert!(told["figures"].as_u64().unwrap() >= 15, "{told}");
    }
    let paper = folder.path().join("report.pdf");
    let address = format!("file://{}", out.join("report.html").display());
    let arguments = [
        "--virtual-time-budget=15000".to_owned(),
        format!("--print-to-pdf={}", paper.display()),
        address,
    ];
    chromium(folder.path(), &arguments).unwrap();
    let paper = fs::read(&paper).unwrap();
    let pages = String::from_utf8_lossy(&paper).matches("/Type /Page\n").count();
    assert!((4..60).contains(&pages), "{pages} pages");
}

/// Every figure is a file beside the report: a picture that parses alone, and its values with a unit.
#[test]
fn figures_are_written_beside_the_report() {
    let folder = quick::simulated();
    let out = folder.path().join("run");
    let run = || quick::run(&folder.path().join("study.toml"), &[], &out).unwrap();
    run();
    let stale = out.join("figures/of-an-earlier-report.svg");
    fs::write(&stale, "<svg/>").unwrap();
    fs::write(out.join("figures/notes.txt"), "mine").unwrap();
    run();
    assert!(!stale.exists() && out.join("figures/notes.txt").exists());
    let page = fs::read_to_string(out.join("report.html")).unwrap();
    let name = |rest: &str| {
        let (_, rest) = rest.split_once("data-name=\"").unwrap();
        rest.split_once('"').unwrap().0.to_owned()
    };
    let names: Vec<String> = page.split("<figure class=\"drawn\"").skip(1).map(name).collect();
    for name in [
        "measurements",
        "residuals",
        "posterior-draws",
        "rank-plots",
        "autocorrelation",
        "pairs",
        "main-effects",
        "loo-pit",
    ] {
        assert!(names.iter().any(|own| own == name), "no {name} in {names:?}");
    }
    for name in names {
        let svg = fs::read_to_string(out.join(format!("figures/{name}.svg"))).unwrap();
        assert!(svg.starts_with("<svg xmlns") && !svg.contains("var(--"), "{name}");
        let csv = fs::read_to_string(out.join(format!("figures/{name}.csv"))).unwrap();
        assert!(csv.starts_with("panel,series,x,y,lower,upper,x axis,y axis\n"), "{name}");
        assert!(csv.lines().count() > 1, "{name} has no values");
    }
    let measured = fs::read_to_string(out.join("figures/measurements.csv")).unwrap();
    assert!(measured.contains("time [") && measured.contains("strain ["), "{measured:.300}");
}
