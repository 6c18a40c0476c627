//! Whole flights on virtual time: agents, MAVLink bytes, plant, log.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    clippy::print_stdout,
    clippy::disallowed_methods,
    reason = "a test reads its logs and prints how fast it was"
)]

mod commands;
mod plan;

use fleet_agent::record::{Recorder, replay};
use fleet_core::types::Vec3;
use fleet_core::wire::Plan;
use fleet_sim::virtual_time::{Outcome, VirtualError, VirtualFlight};
use fleet_sim::world::{End, WorldConfig};
use std::path::PathBuf;
use std::time::Instant;

const PULSE: &str = "[[pulse]]\ndrone = \"d1\"\nt = 4.0\nduration = 1.0\nforce = [-7.5, 0.0, 0.0]\n";

fn world(seed: u64, action: u8, more: &str) -> WorldConfig {
    let vehicle = |id: &str, system: u8, x: f64| {
        format!(
            "[[vehicle]]\nid = \"{id}\"\nsystem = {system}\npad = [{x:.1}, 0.0, 0.2]\n\
             [vehicle.params]\nCOM_OF_LOSS_T = 0.5\nCOM_OBL_RC_ACT = {action}\n"
        )
    };
    let text = format!(
        "seed = {seed}\nfleet = \"fleet\"\n{}{}{more}",
        vehicle("d1", 101, 0.0),
        vehicle("d2", 102, 8.0)
    );
    WorldConfig::parse(&text).unwrap()
}

fn log_path(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("{name}-{}.mcap", std::process::id()))
}

struct Flown {
    outcome: Outcome,
    /// Truth at the samples of mission time k / 10 s.
    tracks: Vec<Vec<Vec3>>,
}

fn fly(config: &WorldConfig, plan: &Plan, log: Option<&PathBuf>) -> Result<Flown, VirtualError> {
    let mut recorder = log.map(|path| Recorder::create(path).unwrap());
    let mut flight = VirtualFlight::new(config, plan.clone())?;
    let mut tracks = vec![Vec::new(); config.vehicles.len()];
    let outcome = flight.fly(recorder.as_mut(), |flight| {
        let on_mission = flight.mission_time().is_some_and(|t| (-0.05..=plan::HORIZON + 0.05).contains(&t));
        for (track, vehicle) in tracks.iter_mut().zip(flight.world().vehicles()) {
            if on_mission {
                track.push(vehicle.truth().p);
            }
        }
    })?;
    if let Some(recorder) = recorder {
        recorder.finish().unwrap();
    }
    Ok(Flown { outcome, tracks })
}

/// Deviation of the truth from the fleet plan [m]: root mean square and largest.
fn deviation(plan: &Plan, drone: usize, track: &[Vec3]) -> (f64, f64) {
    let error = |k: usize| (track[k] - plan.drones[drone].trajectory.position(k as f64 * 0.1)).norm();
    let errors: Vec<f64> = (0..track.len()).map(error).collect();
    let mean = errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64;
    (mean.sqrt(), errors.iter().fold(0.0, |m, e| m.max(*e)))
}

#[test]
fn a_calm_flight_tracks_its_plan_and_lands_on_the_pads() {
    let plan = plan::plan();
    let log = log_path("calm");
    let start = Instant::now();
    let flown = fly(&world(1, 5, ""), &plan, Some(&log)).unwrap();
    let wall = start.elapsed().as_secs_f64();
    println!(
        "{:.1} s simulated in {wall:.2} s: {:.0} x",
        flown.outcome.simulated,
        flown.outcome.simulated / wall
    );
    assert!(flown.outcome.end.values().all(|end| *end == End::Landed), "{:?}", flown.outcome.end);
    for (drone, track) in flown.tracks.iter().enumerate() {
        assert_eq!(track.len(), 201);
        let (rmse, max) = deviation(&plan, drone, track);
        assert!(rmse <= 0.10 && max <= 0.30, "drone {drone}: rmse {rmse} max {max}");
    }
    let mut coarse = plan.clone();
    coarse.sample = 0.1;
    assert!(plan::judge(&coarse, &flown.tracks) > 0.0);
    for drone in ["d1", "d2"] {
        let replay = replay(&log, drone).unwrap();
        assert!(replay.steps > 3900 && replay.first_difference.is_none(), "{replay:?}");
    }
    std::fs::remove_file(log).unwrap();
}

#[test]
fn the_same_seed_gives_the_same_bytes_of_log() {
    let plan = plan::plan();
    let logs = [(1, "one"), (1, "two"), (2, "three")].map(|(seed, name)| {
        let path = log_path(name);
        fly(&world(seed, 5, PULSE), &plan, Some(&path)).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        std::fs::remove_file(path).unwrap();
        bytes
    });
    assert!(logs[0] == logs[1], "same seed");
    assert!(logs[0] != logs[2], "another seed");
}

#[test]
fn a_gust_is_replanned_on_board_and_the_drone_rejoins() {
    let plan = plan::plan();
    let flown = fly(&world(1, 5, PULSE), &plan, None).unwrap();
    let mut stubborn = plan.clone();
    stubborn.replan.enabled = false;
    let pushed = fly(&world(1, 5, PULSE), &stubborn, None).unwrap();
    assert!(flown.outcome.end.values().all(|end| *end == End::Landed), "{:?}", flown.outcome.end);
    let (_, without) = deviation(&plan, 0, &pushed.tracks[0]);
    assert!((0.5..1.2).contains(&without), "the pulse pushes it off: {without}");
    // Twice as long after the pulse as any topic waypoint is away, the plan is met again.
    for k in 150..=200 {
        let away = (flown.tracks[0][k] - plan.drones[0].trajectory.position(k as f64 * 0.1)).norm();
        assert!(away < 0.1, "{away} m away at {} s", k as f64 * 0.1);
    }
    let (rmse, _) = deviation(&plan, 1, &flown.tracks[1]);
    assert!(rmse < 0.1, "the other drone is not disturbed: {rmse}");
}

#[test]
fn a_wall_that_the_plan_does_not_know_ends_in_a_crash() {
    let wall = "[[obstacle]]\nname = \"wall\"\nfaces = [\n\
        { a = [0.0, 1.0, 0.0], b = 4.0 }, { a = [0.0, -1.0, 0.0], b = -3.0 },\n\
        { a = [1.0, 0.0, 0.0], b = 2.0 }, { a = [-1.0, 0.0, 0.0], b = 2.0 },\n\
        { a = [0.0, 0.0, 1.0], b = 9.0 }, { a = [0.0, 0.0, -1.0], b = 0.0 },\n]\n";
    let flown = fly(&world(1, 5, wall), &plan::plan(), None).unwrap();
    assert_eq!(flown.outcome.end["d1"], End::Crashed);
    assert_eq!(flown.outcome.end["d2"], End::Landed);
    let last = flown.tracks[0][200];
    assert!((last.z - 0.2).abs() < 1e-9, "it lies on the ground: {last}");
}

#[test]
fn what_does_not_fit_is_refused_with_its_reason() {
    let mut other = plan::plan();
    other.fleet = "others".into();
    assert!(matches!(fly(&world(1, 5, ""), &other, None), Err(VirtualError::Mismatch(_))));
    let mut one = plan::plan();
    one.drones.truncate(1);
    assert!(matches!(fly(&world(1, 5, ""), &one, None), Err(VirtualError::Mismatch(_))));
    let mut fast = plan::plan();
    fast.limits.v_max = 50.0;
    match fly(&world(1, 5, ""), &fast, None) {
        Err(VirtualError::Refused { of, reason, .. }) => {
            assert!(of == "plan" && reason.contains("v_max"), "{of}: {reason}");
        }
        other => panic!("{:?}", other.map(|f| f.outcome)),
    }
    match fly(&world(1, 0, ""), &plan::plan(), None) {
        Err(VirtualError::Refused { of, reason, .. }) => {
            assert!(of == "preflight" && reason.contains("COM_OBL_RC_ACT"), "{of}: {reason}");
        }
        other => panic!("{:?}", other.map(|f| f.outcome)),
    }
}
