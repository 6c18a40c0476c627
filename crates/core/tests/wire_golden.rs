//! The bytes of one message of every kind, as the golden file holds them.
//!
//! Python's tests decode the same file. After a deliberate change of the wire, write it anew:
//! `FLEET_BLESS=1 cargo test --release -p fleet-core --test wire_golden`.
#![allow(missing_docs, clippy::unwrap_used)] // clippy.toml spares only functions marked as tests

mod common;

use common::messages::{all_down, all_plans, all_status, all_up, envelope};
use fleet_core::types::Nanos;
use fleet_core::wire::{Down, Envelope, Plan, Status, TimeReply, Up, decode, encode};
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::collections::BTreeMap;
use std::fmt::Debug;
use std::path::Path;

/// Encoded messages in hex by kind.
type Golden = BTreeMap<String, Vec<String>>;

fn hex<T: Serialize>(messages: &[T]) -> Vec<String> {
    messages.iter().map(|m| encode(m).unwrap().iter().map(|b| format!("{b:02x}")).collect()).collect()
}

fn down() -> Vec<Envelope<Down>> {
    all_down().into_iter().map(envelope).collect()
}

fn up() -> Vec<Envelope<Up>> {
    all_up().into_iter().map(envelope).collect()
}

fn time() -> Vec<TimeReply> {
    vec![TimeReply { now: Nanos(7_000_000_000) }]
}

#[test]
#[allow(clippy::disallowed_methods)] // the golden file is the point of this test
fn the_bytes_are_those_of_the_golden_file() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/golden/messages.json");
    let now: Golden = [
        ("plan", hex(&all_plans())),
        ("down", hex(&down())),
        ("up", hex(&up())),
        ("status", hex(&all_status())),
        ("time", hex(&time())),
    ]
    .into_iter()
    .map(|(kind, messages)| (kind.to_owned(), messages))
    .collect();
    if std::env::var_os("FLEET_BLESS").is_some() {
        std::fs::write(&path, serde_json::to_string_pretty(&now).unwrap() + "\n").unwrap();
    }
    let golden: Golden = serde_json::from_str(&std::fs::read_to_string(&path).unwrap()).unwrap();
    assert_eq!(now, golden, "the wire format has changed");
}

fn same<T: Serialize + DeserializeOwned + PartialEq + Debug>(messages: &[T]) {
    for message in messages {
        assert_eq!(&decode::<T>(&encode(message).unwrap()).unwrap(), message);
    }
}

#[test]
fn every_message_survives_the_wire() {
    same::<Plan>(&all_plans());
    same(&down());
    same(&up());
    same::<Status>(&all_status());
    same(&time());
}
