//! Segments that npTDMS does not write: interleaved, big-endian, incremental, unfinished, of `DAQmx`.
//!
//! Where `LACUNA_PYTHON` has npTDMS, it reads each file too, and must find the same numbers.

use std::path::Path;
use std::process::Command;

use super::build::{
    BIG, DAQMX, F64, FIRST, I16, I32, INTERLEAVED, METADATA, NEW_LIST, NO_DATA, RAW, TEXT, TIME,
    Writer, doubles, segment, with_offsets,
};
use super::{all, written};

const READ: &str = r#"
import json, logging, sys
logging.disable()
from nptdms import TdmsFile
file = TdmsFile.read(sys.argv[1], raw_timestamps=True)
print(json.dumps([[g.name + "/" + c.name, [float(x) for x in c[:]]] for g in file.groups() for c in g.channels()]))
"#;

/// Fails if npTDMS is there and reads other numbers. It lists groups after each other, here all channels are in one.
fn as_nptdms(path: &Path, found: &[(&str, Vec<f64>)]) {
    let Ok(python) = std::env::var("LACUNA_PYTHON") else { return };
    let has = Command::new(&python).args(["-c", "import nptdms"]).output().unwrap();
    if !has.status.success() {
        println!("not compared: {python} does not have npTDMS");
        return;
    }
    let done = Command::new(&python).args(["-c", READ]).arg(path).output().unwrap();
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let theirs: Vec<(String, Vec<f64>)> = serde_json::from_slice(&done.stdout).unwrap();
    let ours: Vec<_> = found.iter().map(|(n, v)| ((*n).to_owned(), v.clone())).collect();
    assert_eq!(theirs, ours);
}

fn check(bytes: &[u8], right: &[(&str, Vec<f64>)]) {
    let (_folder, path) = written(bytes);
    let found = all(&path).unwrap();
    let found: Vec<(&str, Vec<f64>)> =
        found.iter().map(|(name, values)| (name.as_str(), values.clone().unwrap())).collect();
    assert_eq!(found, right);
    as_nptdms(&path, right);
}

/// Two channels of different types, `count` samples of each in a chunk.
fn two(big: bool, count: u64) -> Vec<u8> {
    let objects = Writer::new(big).u32(4).object("/", NO_DATA).object("/'g'", NO_DATA);
    objects.samples("/'g'/'a'", I16, count).samples("/'g'/'b'", F64, count).bytes
}

fn sample(big: bool, i: i16) -> [Vec<u8>; 2] {
    let a = Writer::new(big).number(i.to_le_bytes()).bytes;
    [a, doubles(big, &[f64::from(i) + 0.5])]
}

#[test]
fn samples_are_interleaved_or_contiguous_in_both_byte_orders() {
    let a: Vec<f64> = (0..6).map(|i| f64::from(i - 2)).collect();
    let b: Vec<f64> = a.iter().map(|x| x + 0.5).collect();
    let right = [("g/a", a), ("g/b", b)];
    for big in [false, true] {
        let order = if big { BIG } else { 0 };
        let rows: Vec<u8> = (-2..4).flat_map(|i| sample(big, i).concat()).collect();
        check(&segment(FIRST | INTERLEAVED | order, &two(big, 6), &rows), &right);
        // Three chunks of two samples.
        check(&segment(FIRST | INTERLEAVED | order, &two(big, 2), &rows), &right);
        let chunk = |from: i16, to: i16| {
            let column = |c: usize| (from..to).flat_map(move |i| sample(big, i)[c].clone());
            column(0).chain(column(1)).collect::<Vec<u8>>()
        };
        let chunks = [chunk(-2, 0), chunk(0, 2), chunk(2, 4)].concat();
        check(&segment(FIRST | order, &two(big, 2), &chunks), &right);
        // The last chunk is shorter.
        let chunks = [chunk(-2, 2), chunk(2, 4)].concat();
        check(&segment(FIRST | order, &two(big, 4), &chunks), &right);
    }
}

/// The second segment has no metadata; the third has `b` as before and no `a`; the fourth adds `c`, longer, to `b`; the
/// fifth is big-endian and has a list of its own.
#[test]
fn segments_say_only_what_changes() {
    let (a, b, c) = ("/'g'/'a'", "/'g'/'b'", "/'g'/'c'");
    let first = Writer::new(false).u32(2).samples(a, F64, 1).samples(b, F64, 2).bytes;
    let third = Writer::new(false).u32(2).object(a, NO_DATA).object(b, 0).bytes;
    let fourth = Writer::new(false).u32(1).samples(c, I32, 3).bytes;
    let fifth = Writer::new(true).u32(2).object(a, 0).samples(c, I32, 1).bytes;
    let file = [
        segment(FIRST, &first, &doubles(false, &[1.0, 2.0, 3.0])),
        segment(RAW, &[], &doubles(false, &[4.0, 5.0, 6.0, 7.0, 8.0, 9.0])),
        segment(METADATA | RAW, &third, &doubles(false, &[10.0, 11.0])),
        segment(
            METADATA | RAW,
            &fourth,
            &[doubles(false, &[12.0, 13.0]), [1_i32, -2, 3].map(i32::to_le_bytes).concat()]
                .concat(),
        ),
        segment(
            FIRST | BIG,
            &fifth,
            &[&doubles(true, &[14.0])[..], &15_i32.to_be_bytes()].concat(),
        ),
        segment(METADATA | NEW_LIST, &Writer::new(false).u32(0).bytes, &[]),
    ]
    .concat();
    check(
        &file,
        &[
            ("g/a", vec![1.0, 4.0, 7.0, 14.0]),
            ("g/b", vec![2.0, 3.0, 5.0, 6.0, 8.0, 9.0, 10.0, 11.0, 12.0, 13.0]),
            ("g/c", vec![1.0, -2.0, 3.0, 15.0]),
        ],
    );
}

#[test]
fn an_unfinished_segment_is_read_as_far_as_it_goes() {
    let metadata = two(false, 3);
    let whole = [
        (0..3).flat_map(|i| sample(false, i)[0].clone()).collect::<Vec<u8>>(),
        doubles(false, &[0.5, 1.5, 2.5]),
    ]
    .concat();
    let raw = metadata.len() as u64;
    let cut = |contents: u32, count: usize| {
        let data = [whole.clone(), whole.clone()].concat();
        with_offsets(contents, &metadata, &data[..count], u64::MAX, raw)
    };
    let (a, b) = (vec![0.0, 1.0, 2.0], vec![0.5, 1.5, 2.5]);
    // The second chunk ends inside the second number of `b`.
    let right = [("g/a", [a.clone(), a.clone()].concat()), ("g/b", [&b[..], &[0.5]].concat())];
    check(&cut(FIRST, 30 + 6 + 9), &right);
    // The second chunk ends inside the last number of `a`.
    check(&cut(FIRST, 30 + 5), &[("g/a", [&a[..], &a[..2]].concat()), ("g/b", b.clone())]);
    let rows: Vec<u8> = (0..3).flat_map(|i| sample(false, i).concat()).collect();
    let file = with_offsets(FIRST | INTERLEAVED, &metadata, &rows[..25], u64::MAX, raw);
    check(&file, &[("g/a", a[..2].to_vec()), ("g/b", b[..2].to_vec())]);
    // Metadata that were not finished.
    let file = [segment(FIRST, &metadata, &whole), cut(FIRST, 0)[..60].to_vec()].concat();
    check(&file, &[("g/a", a), ("g/b", b)]);
}

#[test]
fn moments_are_seconds_since_the_first_in_both_byte_orders() {
    for big in [false, true] {
        let metadata = Writer::new(big).u32(1).samples("/'g'/'t'", TIME, 3).bytes;
        let moment = |seconds: i64, fraction: u64| {
            let time = (i128::from(seconds) << 64) + i128::from(fraction);
            Writer::new(big).number(time.to_le_bytes()).bytes
        };
        let data = [
            moment(3_900_000_000, 7),
            moment(3_900_000_000, 7 + (1 << 44)),
            moment(3_900_000_001, 7),
        ];
        let order = if big { BIG } else { 0 };
        let (_folder, path) = written(&segment(FIRST | order, &metadata, &data.concat()));
        let found = all(&path).unwrap()[0].1.clone().unwrap();
        assert_eq!(found, [0.0, 2.0_f64.powi(-20), 1.0]);
    }
}

/// Index of raw data of `DAQmx`: one scaler, one buffer two bytes wide.
fn daqmx(path: &str) -> Vec<u8> {
    let index = Writer::new(false).text(path).u32(0x1269).u32(0xffff_ffff).u32(1).u64(2);
    let scaler = index.u32(1).u32(3).u32(0).u32(0).u32(0).u32(0);
    scaler.u32(1).u32(2).u32(0).bytes
}

#[test]
fn what_is_no_number_is_refused_by_name_and_the_rest_is_read() {
    let metadata =
        [2_u32.to_le_bytes().to_vec(), daqmx("/'g'/'raw'"), daqmx("/'g'/'raw 2'")].concat();
    let text =
        Writer::new(false).u32(2).text("/'g'/'text'").u32(28).u32(TEXT).u32(1).u64(2).u64(11);
    let text = text.u32(0).samples("/'g'/'x'", F64, 1).bytes;
    let data = [&[1, 0, 0, 0, 3, 0, 0, 0][..], b"abc", &doubles(false, &[4.5])].concat();
    let extended =
        Writer::new(false).u32(2).samples("/'g'/'long'", 11, 1).samples("/'g'/'y'", F64, 1);
    let file = [
        segment(FIRST | DAQMX | INTERLEAVED, &metadata, &[0; 8]),
        segment(FIRST, &text, &data),
        segment(FIRST, &extended.bytes, &[0; 24]),
    ]
    .concat();
    let (_folder, path) = written(&file);
    let found = all(&path).unwrap();
    let said = |name: &str| found.iter().find(|(own, _)| own == name).unwrap().1.clone();
    assert_eq!(said("g/x"), Ok(vec![4.5]));
    for (name, right) in [
        ("g/raw", "record.tdms, channel `g/raw`: holds raw data of DAQmx"),
        ("g/raw 2", "channel `g/raw 2`: holds raw data of DAQmx"),
        ("g/text", "channel `g/text`: holds text"),
        ("g/long", "channel `g/long`: holds numbers of extended precision"),
        (
            "g/y",
            "channel `g/y`: shares a segment with samples whose place in the file is not known",
        ),
    ] {
        let error = said(name).unwrap_err();
        assert!(error.contains(right), "{error}");
    }
}
