//! Golden files that Python reads with independent decoders (pymavlink, the `mcap` package).
//!
//! `FLEET_WRITE_GOLDEN=1 cargo nextest run -p fleet-agent golden` writes them anew after a wanted
//! change of format.
// A test reads and writes files, and an unwrap in it is its failure.
#![allow(clippy::disallowed_methods, clippy::unwrap_used)]

use fleet_agent::io::{Output, Stream, Tick, VehicleCmd, VehicleMode};
use fleet_agent::mavlink::Codec;
use fleet_agent::record::{Log, Recorder, SchemaName, record_outputs};
use fleet_core::types::{Nanos, Quat, Reference, Setpoint, State, Vec3};
use fleet_core::wire::{Event, EventKind, Mode, ReplanNotice, ReplanOutcome, Up};
use serde::Serialize;
use std::path::{Path, PathBuf};

fn golden(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/golden").join(name)
}

fn check(name: &str, bytes: &[u8]) {
    let path = golden(name);
    if std::env::var_os("FLEET_WRITE_GOLDEN").is_some() {
        std::fs::write(&path, bytes).unwrap();
    }
    assert!(std::fs::read(&path).unwrap() == bytes, "{} is not what this build writes", path.display());
}

#[derive(Serialize)]
struct Frame {
    command: VehicleCmd,
    boot_ms: u32,
    hex: String,
}

#[test]
fn golden_mavlink_frames() {
    let mut commands = vec![
        VehicleCmd::Heartbeat,
        VehicleCmd::Rates(Setpoint { rates: Vec3::new(0.5, -0.25, 0.125), thrust: 0.5 }),
        VehicleCmd::Rates(Setpoint { rates: Vec3::zeros(), thrust: 0.0 }),
        VehicleCmd::Rates(Setpoint { rates: Vec3::zeros(), thrust: 1.5 }),
        VehicleCmd::Arm { arm: true, force: false },
        VehicleCmd::Arm { arm: false, force: false },
        VehicleCmd::Arm { arm: false, force: true },
        VehicleCmd::ReadParam { name: "COM_OF_LOSS_T".to_owned() },
        VehicleCmd::ReadParam { name: "SIXTEEN_LETTERS_".to_owned() },
    ];
    for mode in
        [VehicleMode::Offboard, VehicleMode::Land, VehicleMode::Loiter, VehicleMode::Other(4 << 16 | 5 << 24)]
    {
        commands.push(VehicleCmd::SetMode { mode });
    }
    for stream in [
        Stream::Attitude,
        Stream::LocalPosition,
        Stream::Odometry,
        Stream::Landed,
        Stream::Battery,
        Stream::Origin,
    ] {
        commands.push(VehicleCmd::Interval { stream, period_us: 10_000 });
        commands.push(VehicleCmd::Request { stream });
    }
    let mut codec = Codec::new(42, 42);
    let frames: Vec<Frame> = commands
        .into_iter()
        .zip(1000..)
        .map(|(command, boot_ms)| {
            let bytes = codec.encode(&command, boot_ms);
            Frame { command, boot_ms, hex: bytes.iter().map(|b| format!("{b:02x}")).collect() }
        })
        .collect();
    let mut text = serde_json::to_string_pretty(&frames).unwrap();
    text.push('\n');
    check("mavlink_frames.json", text.as_bytes());
}

fn outputs(now: Nanos) -> Vec<Output> {
    let state = State {
        at: Nanos(now.0 - 4_000_000),
        p: Vec3::new(1.0, 2.0, 3.0),
        v: Vec3::new(0.1, 0.2, 0.3),
        q: Quat::from_euler_angles(0.1, 0.2, 0.3),
        w: Vec3::new(0.01, 0.02, 0.03),
    };
    let tick = Tick {
        mode: Mode::Track,
        mission_time: Some(1.5),
        state: Some(state),
        reference: Some(Reference::rest(Vec3::new(1.0, 2.0, 3.25), 0.5)),
        setpoint: Some(Setpoint { rates: Vec3::new(0.4, 0.5, 0.6), thrust: 0.45 }),
        deviation: Some(0.25),
        hover_thrust: 0.42,
    };
    let event = Event {
        drone: "d1".to_owned(),
        mission_time: Some(1.5),
        kind: EventKind::Mode { from: Mode::Takeoff, to: Mode::Track },
        cause: "mission time 0 reached".to_owned(),
    };
    let notice = ReplanNotice {
        drone: "d1".to_owned(),
        outcome: ReplanOutcome::Infeasible,
        t_event: 1.25,
        deviation: 0.5,
        t_splice: None,
        t_rejoin: None,
        trajectory: None,
    };
    let publish = |message: Up| Output::Publish { bytes: vec![1, 2, 3], message: Box::new(message) };
    vec![
        Output::Tick(Box::new(tick)),
        publish(Up::Event(event)),
        publish(Up::Replan(notice)),
        Output::Vehicle(VehicleCmd::Heartbeat),
    ]
}

fn write_log(path: &Path) {
    let mut recorder = Recorder::create(path).unwrap();
    for step in 1..=3_u64 {
        let at_ns = 1_000_000_000 + step * 10_000_000;
        record_outputs(&mut recorder, "d1", Nanos(at_ns), at_ns, &outputs(Nanos(at_ns))).unwrap();
        recorder.cbor("/d1/inbox", at_ns, vec![0x83, 1, 2, 3]).unwrap();
    }
    recorder.finish().unwrap();
}

#[test]
fn golden_log() {
    let path = std::env::temp_dir().join(format!("fleet-golden-{}.mcap", std::process::id()));
    write_log(&path);
    let bytes = std::fs::read(&path).unwrap();
    std::fs::remove_file(&path).unwrap();
    check("record.mcap", &bytes);
}

#[test]
fn every_schema_lists_only_properties_that_it_describes() {
    for schema in SchemaName::ALL {
        let text = schema.json_schema();
        assert_eq!(text["title"], schema.as_str());
        for name in text["required"].as_array().unwrap() {
            assert!(text["properties"].get(name.as_str().unwrap()).is_some(), "{name}");
        }
    }
}

#[test]
fn a_log_in_a_missing_directory_names_the_file() {
    let error = Recorder::create("/nonexistent/x.mcap").unwrap_err().to_string();
    assert!(error.starts_with("/nonexistent/x.mcap: cannot create the log"), "{error}");
}
