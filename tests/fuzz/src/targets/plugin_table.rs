//! Input from libraries of plugins: records, tables, answers, and their JSON.

use std::path::Path;

use lacuna::text::{Complaints, Node, Place, Problems, Sources};
use lacuna_abi::options::Options;
use lacuna_abi::wire::{
    Complaint, ContentsAbout, EnsembleAbout, FailureAbout, HarvestAbout, MeasuredAbout,
    ResponseAbout, SignatureAbout, StatisticAbout, json_of_node, node_of_json, table_of_json,
};
use lacuna_abi::{hostile, record};
use serde_json::Value as Json;

/// The first byte says which part of the boundary gets the rest.
pub fn plugin_table(bytes: &[u8]) {
    let Some((part, rest)) = bytes.split_first() else { return };
    match part {
        b'r' => recorded(rest),
        b't' => {
            if let Err(refusal) = hostile::table(rest) {
                assert!(!refusal.message.is_empty());
            }
        }
        b'a' => answered(rest),
        _ => said(rest),
    }
}

/// A record that is found lists words alone.
fn recorded(bytes: &[u8]) {
    if let Some(found) = record::find(bytes) {
        for (kind, name) in &found.plugins {
            assert!(record::is_word(kind) && record::is_word(name), "{kind} {name}");
        }
    }
}

/// Matrices of an answer have as many numbers as they say.
fn answered(bytes: &[u8]) {
    match hostile::reply(bytes) {
        Ok(reply) => {
            for matrix in &reply.matrices {
                assert_eq!(matrix.as_slice().len(), matrix.rows() * matrix.columns());
            }
            let about: Result<ContentsAbout, _> = reply.json();
            if let Ok(about) = about {
                let _ = about.put_together(&reply.matrices);
            }
            let _ = reply.row();
        }
        Err(refusal) => assert!(refusal.status != lacuna_abi::status::OK, "{refusal:?}"),
    }
}

/// Options come back from JSON to the bit; other texts are read or refused.
fn said(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let mut sources = Sources::default();
    let place = Place::whole(sources.add_argument("options", text.to_owned()));
    let section = Node::table(place.clone());
    let mut problems = Problems::new();
    for complaint in Complaint::read(text) {
        complaint.report(&mut Complaints::new(&section, &mut problems));
    }
    problems.render(&sources);
    FailureAbout::read(text, Path::new("file"), "somebody").to_string();
    let _ = serde_json::from_str::<MeasuredAbout>(text).map(MeasuredAbout::parts);
    let _ = serde_json::from_str::<EnsembleAbout>(text);
    let _ = serde_json::from_str::<HarvestAbout>(text);
    let _ = serde_json::from_str::<ResponseAbout>(text);
    let _ = serde_json::from_str::<SignatureAbout>(text);
    let _ = serde_json::from_str::<StatisticAbout>(text);
    let Ok(json) = serde_json::from_str::<Json>(text) else { return };
    if let Some(node) = node_of_json(&json, &place) {
        let again = json_of_node(&node);
        let twice = node_of_json(&again, &place).map(|node| json_of_node(&node));
        assert_eq!(twice.as_ref(), Some(&again), "{text}");
        if let Json::Object(object) = &json {
            let table = table_of_json(object);
            assert_eq!(
                table_of_json(
                    lacuna_abi::wire::json_of_table(&table).as_object().expect("an object")
                ),
                table
            );
            let options = Options::new(object.clone(), "model.fuzzed".to_owned());
            options.check(&node, &["use"], &mut problems);
            options.schema(&mut schemars::SchemaGenerator::default());
            problems.render(&sources);
        }
    }
}
