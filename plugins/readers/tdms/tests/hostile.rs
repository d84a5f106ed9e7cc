//! Damaged files: an error that names file and place, never a panic, and no memory for what is not there.

use std::path::Path;

use super::super::file::File;
use super::build::{
    BIG, F64, FIRST, INTERLEAVED, METADATA, NO_DATA, RAW, Writer, doubles, segment, with_offsets,
};
use super::{all, sample, written};
use crate::readers::records::store::Store as _;

/// Opens a file with these bytes and reads all that it can. Each error names the file; no channel has more numbers than
/// the file has bytes.
fn survives(path: &Path, bytes: &[u8]) {
    std::fs::write(path, bytes).unwrap();
    match all(path) {
        Ok(channels) => {
            for (name, numbers) in channels {
                match numbers {
                    Ok(numbers) => assert!(numbers.len() <= bytes.len(), "{name}"),
                    Err(text) => assert!(text.contains("record.tdms, channel `"), "{text}"),
                }
            }
        }
        Err(text) => assert!(text.contains("record.tdms"), "{text}"),
    }
}

#[test]
fn truncated_files_are_refused() {
    let (_folder, path) = written(&[]);
    let bytes = std::fs::read(sample("records.tdms")).unwrap();
    let mut starts = 0;
    for length in 0..bytes.len() {
        std::fs::write(&path, &bytes[..length]).unwrap();
        match File::open(&path) {
            // Between two segments the file is a whole one.
            Ok(_) => starts += 1,
            Err(error) => assert!(error.to_string().contains("record.tdms"), "{error}"),
        }
    }
    assert_eq!(starts, 2);
}

#[test]
fn damaged_bytes_do_no_harm() {
    let (_folder, path) = written(&[]);
    for name in ["records.tdms", "types.tdms"] {
        let sound = std::fs::read(sample(name)).unwrap();
        for i in (0..sound.len()).step_by(2) {
            let mut bytes = sound.clone();
            bytes[i] ^= [0xff, 0x80, 0x01][i / 2 % 3];
            survives(&path, &bytes);
        }
    }
}

/// Every count and length of a file of two segments is replaced by large and small ones.
#[test]
fn counts_and_lengths_that_are_not_true_are_told() {
    let objects = Writer::new(false).u32(2).object("/'g'", NO_DATA);
    let metadata = objects.samples("/'g'/'a'", F64, 2).bytes;
    let second = Writer::new(false).u32(1).object("/'g'/'a'", 0).bytes;
    let file = [
        segment(FIRST, &metadata, &doubles(false, &[1.0, 2.0])),
        segment(METADATA | RAW | INTERLEAVED, &second, &doubles(false, &[3.0])),
    ]
    .concat();
    let (_folder, path) = written(&[]);
    for i in 0..file.len().saturating_sub(8) {
        for number in [1, 0x7fff_ffff, 0xffff_ffff, u64::MAX, 1 << 61] {
            let width = if number <= 0xffff_ffff { 4 } else { 8 };
            let mut bytes = file.clone();
            bytes[i..i + width].copy_from_slice(&number.to_le_bytes()[..width]);
            survives(&path, &bytes);
        }
    }
}

#[test]
fn faults_have_their_place() {
    let metadata = |count: u64| Writer::new(false).u32(1).samples("/'g'/'a'", F64, count).bytes;
    let one = |metadata: &[u8], data: &[u8]| segment(FIRST, metadata, data);
    let path = |text: &str| Writer::new(false).u32(1).object(text, NO_DATA).bytes;
    let property =
        Writer::new(false).u32(1).text("/").u32(NO_DATA).u32(1).text("p").u32(0x999).bytes;
    let other_type = Writer::new(false).u32(1).samples("/'g'/'a'", 0x777, 1).bytes;
    let two =
        Writer::new(false).u32(2).samples("/'g'/'a'", F64, 1).samples("/'g'/'b'", F64, 2).bytes;
    let sound = one(&metadata(1), &[0; 8]);
    let mut version = sound.clone();
    version[8] = 1;
    let cases: [(Vec<u8>, &str); 14] = [
        (Vec::new(), "is empty"),
        (b"TDSm".to_vec(), "byte 0: the file ends after 4 of the 28 bytes of a lead-in"),
        (
            [&sound[..], b"TDSx", &[0; 40]].concat(),
            "expected a segment, which begins with `TDSm`, found `TDSx`",
        ),
        (version, "byte 8: the segment has the version"),
        (
            with_offsets(FIRST, &metadata(1), &[0; 8], 1000, 40),
            "ends at byte 1028, and the file ends at byte",
        ),
        (
            with_offsets(FIRST, &metadata(1), &[0; 8], 4, 40),
            "the segment has its data at byte 68 and ends at byte 32",
        ),
        (
            one(&metadata(1 << 62), &[0; 8]),
            "has 4611686018427387904 samples, more than a file can hold",
        ),
        (one(&metadata(3), &[0; 25]), "the segment has 25 bytes of data in chunks of 24"),
        (one(&path("/g"), &[]), "expected a path such as `/'group'/'channel'`, found `/g`"),
        (one(&path("/'g'/'c'/'d'"), &[]), "expected a path such as"),
        (one(&property, &[]), "the property `p` has the type 0x999, whose size is not known"),
        (one(&other_type, &[]), "`/'g'/'a'` has samples of the unknown type 0x777"),
        (
            segment(FIRST | INTERLEAVED, &two, &[0; 24]),
            "is interleaved, and its channels have different lengths",
        ),
        (segment(RAW, &[], &[0; 8]), "the segment has 8 bytes of data, and no channel"),
    ];
    for (bytes, right) in cases {
        let (_folder, path) = written(&bytes);
        let error = all(&path).unwrap_err();
        assert!(error.contains(right) && error.contains("record.tdms"), "{error}\nand not {right}");
    }
    let as_before = Writer::new(true).u32(1).object("/'g'/'a'", 0).bytes;
    let (_folder, path) = written(&segment(FIRST | BIG, &as_before, &[0; 8]));
    let error = all(&path).unwrap_err();
    assert!(
        error.contains("byte 32: `/'g'/'a'` has its samples as in an earlier segment"),
        "{error}"
    );
}

/// Names of `LabVIEW` have slashes; two channels whose names are the same with them are not mistaken for each other.
#[test]
fn names_that_are_not_unique_are_told() {
    let objects = Writer::new(false).u32(2).samples("/'a/b'/'c'", F64, 1);
    let metadata = objects.samples("/'a'/'b/c'", F64, 1).bytes;
    let (_folder, path) = written(&segment(FIRST, &metadata, &doubles(false, &[1.0, 2.0])));
    let error = File::open(&path).unwrap().array("a/b/c").unwrap_err().to_string();
    assert!(error.contains("channel `a/b/c`: is the name of two channels"), "{error}");
}
