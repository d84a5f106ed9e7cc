//! Damaged files: any answer is acceptable except a panic, endless work or unbounded memory.

use std::path::Path;

use lacuna::math::random::{Stream, below};

use super::super::container::Container;
use super::super::exodus::{Exodus, Kind};
use super::super::heartbeat::Heartbeat;
use super::super::inspect;
use super::super::parts::Results;
use super::super::probe::Probe;
use super::{reference, sample};

/// Reads everything that the readers would: every variable at one entity, by id and by point.
fn use_up(bytes: Vec<u8>) -> bool {
    let path = Path::new("damaged");
    if !bytes.starts_with(b"CDF") && !bytes.starts_with(b"\x89HDF") {
        return Heartbeat::parse(path, &bytes).is_ok();
    }
    let Ok(file) = Container::from_bytes(path, bytes).and_then(Exodus::from_container) else {
        return false;
    };
    let names: Vec<(Kind, String)> = Kind::ALL
        .into_iter()
        .flat_map(|kind| file.names(kind).iter().take(3).map(move |n| (kind, n.clone())))
        .collect();
    let _ = file.container.texts("info_records");
    let _ = inspect::exodus(&file);
    let results = Results::single(file);
    let mut whole = true;
    for (kind, name) in names {
        let bare = Probe { kind: Some(kind), ..Probe::named(&name) };
        for probe in [
            bare.clone(),
            Probe { id: Some(1), ..bare.clone() },
            Probe { nearest: Some([0.0; 3]), ..bare },
        ] {
            whole &= results.series(&name, &probe).is_ok();
        }
    }
    whole
}

fn samples() -> Vec<(String, Vec<u8>)> {
    let shipped =
        ["hist_cdf2.h", "hist_cdf5.h", "hist_nc4.h", "hb_default.txt", "hb_spyhis.txt"].map(sample);
    let others = ["seacas_exodus.g", "lcm_cuboid_01.gold.e.4.0", "exodusii_noh.exo"];
    let others = others.iter().filter_map(|name| reference(&format!("real/{name}")));
    shipped
        .into_iter()
        .chain(others)
        .map(|path| (path.display().to_string(), std::fs::read(path).unwrap()))
        .collect()
}

#[test]
fn flipped_bytes_do_no_harm() {
    for (number, (_, bytes)) in samples().into_iter().enumerate() {
        let mut random = Stream::root(20_220_415).at(number as u64).generator();
        for round in 0..100 {
            let mut damaged = bytes.clone();
            // A wrong byte does most harm in a header.
            let range = if round % 2 == 0 { bytes.len().min(4096) } else { bytes.len() };
            for _ in 0..=round % 4 {
                let at = below(&mut random, range);
                damaged[at] = below(&mut random, 256) as u8;
            }
            use_up(damaged);
        }
    }
}

#[test]
fn a_file_cut_anywhere_is_refused() {
    for (name, bytes) in samples() {
        let text = !bytes.starts_with(b"CDF") && !bytes.starts_with(b"\x89HDF");
        for part in 0..40 {
            let length = bytes.len() * part / 40;
            let answered = use_up(bytes[..length].to_vec());
            assert!(text || !answered, "{name} cut to {length} of {} bytes", bytes.len());
        }
    }
}

#[test]
fn the_reason_is_named() {
    let bytes = std::fs::read(sample("hist_cdf2.h")).unwrap();
    let reason = |bytes: &[u8]| {
        let container = Container::from_bytes(Path::new("run.h"), bytes.to_vec());
        container.err().unwrap().to_string()
    };
    assert_eq!(reason(b""), "run.h: is empty");
    assert!(reason(b"hello, world").contains("is not a netCDF file: it starts with `hello, w`"));
    assert!(reason(&bytes[..bytes.len() / 2]).contains("declares 100 records"));
    assert!(reason(&bytes[..300]).contains("truncated or damaged"));
}
