//! `examples/um_bridge`: three official servers in Python, following its README in a folder outside the project.

use std::net::{Ipv4Addr, TcpListener};
use std::time::{Duration, Instant};

use lacuna_um_bridge::Client;

use super::agrees_with_least_squares;
use crate::python::interpreter;
use crate::quick;
use crate::readme::Walk;

const FOLDER: &str = "examples/um_bridge";

/// Three free ports.
fn free_ports() -> [u16; 3] {
    let listeners = [(); 3].map(|()| TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap());
    listeners.map(|listener| listener.local_addr().unwrap().port())
}

#[test]
fn the_study_on_three_servers_goes_as_its_readme_says() {
    if interpreter("umbridge").is_none() {
        return;
    }
    let mut walk = Walk::begin(&[FOLDER, "configs/um_bridge"], "");
    let ports = free_ports();
    let [page, study] = ["README.md", "study.toml"].map(|file| walk.path(FOLDER).join(file));
    for (old, new) in [4242, 4243, 4244].into_iter().zip(ports) {
        quick::replace(&page, &format!("server.py {old} &"), &format!("server.py {new} &"));
        quick::replace(&study, &format!(":{old}\""), &format!(":{new}\""));
    }
    walk.follow("Three servers");
    let begun = Instant::now();
    for port in ports {
        let url = format!("http://localhost:{port}");
        let client = Client::new(&url, Duration::from_secs(5), 0);
        while client.info().is_err() {
            assert!(begun.elapsed() < Duration::from_secs(60), "a server does not start");
            std::thread::sleep(Duration::from_millis(50));
        }
    }
    walk.follow("The study");
    agrees_with_least_squares(&quick::summary(&walk.path("runs/pool")));
    // Each server is asked for its information.
    walk.end(1);
    let study = format!("{FOLDER}/study.toml");
    walk.give(&format!("lacuna check {study}"), 0);
    let said = walk.give(&format!("lacuna run {study} --out runs/none"), 2);
    assert!(said.contains(&format!("no server at http://localhost:{}", ports[1])), "{said}");
    assert!(said.contains("1 problem in"), "{said}");
}
