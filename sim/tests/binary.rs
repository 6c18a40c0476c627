//! The real-time binary: exit codes, signals, clients.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    clippy::disallowed_methods,
    reason = "a test owns processes, sockets and files"
)]

use fleet_agent::mavlink::framing::frames;
use mavlink::dialects::common::{HEARTBEAT_DATA, MavMessage};
use mavlink::{MAVLinkV2MessageRaw, MavHeader};
use std::io::{BufRead, BufReader, Read};
use std::net::UdpSocket;
use std::path::PathBuf;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

struct Sim {
    child: Child,
    address: String,
}

fn file(name: &str, text: &str) -> PathBuf {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("{name}-{}", std::process::id()));
    std::fs::write(&path, text).unwrap();
    path
}

fn world(address: &str) -> String {
    format!(
        "seed = 1\nfleet = \"fleet\"\n[[vehicle]]\nid = \"d1\"\nsystem = 133\npad = [0.0, 0.0, 0.2]\nmavlink = \"{address}\"\n"
    )
}

fn command(config: &PathBuf, more: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_fleet-sim"));
    command.arg("run").arg("--config").arg(config).args(more);
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

impl Sim {
    fn start(name: &str, more: &[&str]) -> Self {
        let config = file(name, &world("127.0.0.1:0"));
        let mut child = command(&config, more).spawn().unwrap();
        let mut line = String::new();
        BufReader::new(child.stdout.as_mut().unwrap()).read_line(&mut line).unwrap();
        let ready: serde_json::Value = serde_json::from_str(&line).unwrap();
        assert_eq!(ready["ready"], true);
        assert_eq!(ready["vehicles"][0]["id"], "d1");
        assert_eq!(ready["vehicles"][0]["system"], 133);
        let address = ready["vehicles"][0]["mavlink"].as_str().unwrap().to_owned();
        Self { child, address }
    }

    fn wait(&mut self) -> ExitStatus {
        let start = Instant::now();
        loop {
            if let Some(status) = self.child.try_wait().unwrap() {
                return status;
            }
            if start.elapsed() > Duration::from_secs(20) {
                self.child.kill().unwrap();
                panic!("did not end within 20 s");
            }
            std::thread::sleep(Duration::from_millis(5));
        }
    }
}

impl Drop for Sim {
    fn drop(&mut self) {
        // Ended already in most tests; then there is nothing to kill.
        if self.child.try_wait().unwrap().is_none() {
            self.child.kill().unwrap();
            self.child.wait().unwrap();
        }
    }
}

fn fails(config: &PathBuf) -> (Option<i32>, String) {
    let output = command(config, &[]).output().unwrap();
    (output.status.code(), String::from_utf8(output.stderr).unwrap())
}

#[test]
fn a_taken_port_is_exit_4_and_named() {
    let taken = UdpSocket::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap().to_string();
    let (code, text) = fails(&file("taken.toml", &world(&address)));
    assert_eq!(code, Some(4), "{text}");
    assert!(text.contains(&address) && text.contains("d1") && !text.contains("panicked"), "{text}");
}

#[test]
fn bad_input_is_exit_2_and_names_file_and_field() {
    let bad = file("bad.toml", &world("127.0.0.1:0").replace("system = 133", "system = 0"));
    let (code, text) = fails(&bad);
    assert_eq!(code, Some(2), "{text}");
    assert!(text.contains("vehicle[0].system") && text.contains(bad.to_str().unwrap()), "{text}");
    let (code, text) = fails(&PathBuf::from("/nonexistent/world.toml"));
    assert_eq!(code, Some(2), "{text}");
    let garbage = file("garbage.cbor", "no plan");
    let world = file("virtual.toml", &world("127.0.0.1:0"));
    let output = Command::new(env!("CARGO_BIN_EXE_fleet-sim"))
        .args(["virtual", "--config", world.to_str().unwrap(), "--plan", garbage.to_str().unwrap()])
        .output()
        .unwrap();
    let text = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{text}");
    assert!(text.contains(garbage.to_str().unwrap()) && !text.contains("panicked"), "{text}");
}

#[test]
fn signals_end_it_cleanly_with_a_whole_log() {
    for signal in ["-INT", "-TERM"] {
        let log = file(&format!("signal{signal}.mcap"), "");
        let mut sim = Sim::start(&format!("signal{signal}.toml"), &["--log", log.to_str().unwrap()]);
        std::thread::sleep(Duration::from_millis(300));
        let id = sim.child.id().to_string();
        assert!(Command::new("kill").args([signal, &id]).status().unwrap().success());
        assert_eq!(sim.wait().code(), Some(0));
        let mut rest = String::new();
        sim.child.stdout.take().unwrap().read_to_string(&mut rest).unwrap();
        let done: serde_json::Value = serde_json::from_str(rest.lines().last().unwrap()).unwrap();
        assert_eq!((&done["done"], &done["end"]["d1"]), (&true.into(), &"idle".into()));
        let bytes = std::fs::read(&log).unwrap();
        let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
        assert!(summary.channels.values().any(|c| c.topic == "/d1/truth"));
        UdpSocket::bind(&sim.address).unwrap();
    }
}

#[test]
fn a_full_disk_is_exit_4_and_named() {
    let mut sim = Sim::start("full.toml", &["--log", "/dev/full"]);
    std::thread::sleep(Duration::from_millis(300));
    let id = sim.child.id().to_string();
    assert!(Command::new("kill").args(["-INT", &id]).status().unwrap().success());
    assert_eq!(sim.wait().code(), Some(4));
    let mut text = String::new();
    sim.child.stderr.take().unwrap().read_to_string(&mut text).unwrap();
    assert!(text.contains("/dev/full: cannot write the log") && !text.contains("panicked"), "{text}");
}

#[test]
fn an_abandoned_simulator_ends_by_itself() {
    let mut sim = Sim::start("abandoned.toml", &["--exit-when-landed"]);
    drop(sim.child.stdin.take());
    assert_eq!(sim.wait().code(), Some(0));
}

#[test]
fn every_client_that_writes_is_answered() {
    let sim = Sim::start("clients.toml", &[]);
    let clients = [0, 1].map(|_| UdpSocket::bind("127.0.0.1:0").unwrap());
    let mut raw = MAVLinkV2MessageRaw::new();
    let from = MavHeader { system_id: 245, component_id: 190, sequence: 0 };
    raw.serialize_message(from, &MavMessage::HEARTBEAT(HEARTBEAT_DATA::DEFAULT));
    for client in &clients {
        client.send_to(raw.raw_bytes(), &sim.address).unwrap();
    }
    for client in &clients {
        client.set_read_timeout(Some(Duration::from_secs(10))).unwrap();
        let mut buffer = [0; 2048];
        let mut heard = std::collections::BTreeSet::new();
        while !(heard.contains(&0) && heard.contains(&30) && heard.contains(&245)) {
            let length = client.recv(&mut buffer).unwrap();
            for frame in frames(&buffer[..length]) {
                assert_eq!((frame.header.system_id, frame.header.component_id), (133, 1));
                heard.insert(frame.id);
            }
        }
    }
}
