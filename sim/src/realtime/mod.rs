//! Real time: 1 kHz physics in simulated time, several steps per wake, UDP to any client.
// This is where the simulator meets clock, sockets and signals.
#![allow(clippy::disallowed_methods)]

mod clients;
mod recording;
mod stdin;

use crate::exit::Failure;
use crate::output::print_line;
use clients::Clients;
use fleet_core::types::Nanos;
use fleet_sim::log;
use fleet_sim::world::{End, STEP, Vehicle, World, WorldConfig};
use recording::{Entry, Recording};
use serde::Serialize;
use signal_hook::consts::{SIGINT, SIGTERM};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};
use stdin::Stdin;

/// Sleep between wakes; each wake catches up with the wall clock.
const WAKE: Duration = Duration::from_micros(1000);
/// Most steps in one wake: after a longer stall simulated time falls behind and says so.
const CATCH_UP: u32 = 250;
/// Disarmed for so long is the end of a flight [s].
const SETTLED: f64 = 1.0;

#[derive(Serialize)]
struct Ready<'a> {
    ready: bool,
    vehicles: Vec<ReadyVehicle<'a>>,
}

#[derive(Serialize)]
struct ReadyVehicle<'a> {
    id: &'a str,
    system: u8,
    mavlink: String,
}

#[derive(Serialize)]
struct Done<'a> {
    done: bool,
    end: BTreeMap<&'a str, End>,
}

/// Runs until stopped by a signal or, if asked for, by the end of the flight.
///
/// # Errors
/// When an address is taken, the log cannot be written, or a parameter is wrong.
pub fn run(config: &WorldConfig, log: Option<&Path>, exit_when_landed: bool) -> Result<(), Failure> {
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM] {
        signal_hook::flag::register(signal, Arc::clone(&stop))
            .map_err(|error| Failure::Environment(format!("cannot catch signal {signal}: {error}")))?;
    }
    let mut world = World::new(config).map_err(|error| Failure::Input(error.to_string()))?;
    let mut clients = Vec::new();
    for vehicle in &config.vehicles {
        clients.push(Clients::bind(&vehicle.id, vehicle.mavlink)?);
    }
    let recording = log.map(Recording::start).transpose()?;
    print_ready(&world, &clients)?;

    let mut clock = Clock::new()?;
    let mut stdin = Stdin::open();
    while !stop.load(Ordering::Relaxed) {
        while let Some(line) = stdin.next() {
            world.set_t0(Nanos(line.t0_unix_ns.saturating_sub(clock.unix_base)));
        }
        for (client, vehicle) in clients.iter_mut().zip(world.vehicles_mut()) {
            client.receive(Nanos(clock.elapsed()), vehicle);
        }
        advance(&mut world, &mut clock, recording.as_ref())?;
        for (client, vehicle) in clients.iter_mut().zip(world.vehicles_mut()) {
            let outgoing = vehicle.autopilot_mut().take_outgoing();
            client.send(vehicle.id(), &outgoing);
        }
        if exit_when_landed && flight_is_over(&world, stdin.ended()) {
            break;
        }
        std::thread::sleep(WAKE);
    }
    if let Some(recording) = recording {
        recording.finish()?;
    }
    print_line(&Done { done: true, end: world.vehicles().iter().map(|v| (v.id(), v.end())).collect() });
    Ok(())
}

/// Steps the world until it has caught up with the wall clock.
fn advance(world: &mut World, clock: &mut Clock, recording: Option<&Recording>) -> Result<(), Failure> {
    for _ in 0..CATCH_UP {
        if world.now().0 + STEP > clock.elapsed() {
            return Ok(());
        }
        if let Some(recording) = recording {
            let (now, t) = (world.now(), world.mission_time());
            for message in
                world.vehicles().iter().filter_map(|v| log::truth(v, now, t, clock.unix_base + now.0))
            {
                recording.write(Entry::Truth(message))?;
            }
        }
        for crash in world.step() {
            tracing::error!(drone = crash.drone, what = crash.what, p = ?crash.p.as_slice(), "crash");
            if let Some(recording) = recording {
                let at_ns = clock.unix_base + crash.at.0;
                recording.write(Entry::Crash { at_ns, crash })?;
            }
        }
    }
    let behind = clock.elapsed().saturating_sub(world.now().0 + STEP);
    if behind > 0 {
        clock.fall_behind(behind);
        tracing::warn!(ms = behind / 1_000_000, "the machine is too slow; simulated time fell behind");
    }
    Ok(())
}

/// All vehicles have flown and are disarmed; or nobody commands any more and none is armed.
fn flight_is_over(world: &World, abandoned: bool) -> bool {
    let now = world.now();
    let settled = world.vehicles().iter().all(|v| v.disarmed_for(now) >= SETTLED);
    settled && (abandoned || world.vehicles().iter().all(Vehicle::was_armed))
}

fn print_ready(world: &World, clients: &[Clients]) -> Result<(), Failure> {
    let mut vehicles = Vec::new();
    for (client, vehicle) in clients.iter().zip(world.vehicles()) {
        vehicles.push(ReadyVehicle {
            id: vehicle.id(),
            system: vehicle.autopilot().system(),
            mavlink: client.address()?.to_string(),
        });
    }
    print_line(&Ready { ready: true, vehicles });
    Ok(())
}

/// Simulated time against the wall clock.
struct Clock {
    start: Instant,
    unix_base: u64,
    lost: u64,
}

impl Clock {
    fn new() -> Result<Self, Failure> {
        let unix = SystemTime::now()
            .duration_since(UNIX_EPOCH)
            .map_err(|_| Failure::Environment("the system clock stands before 1970".into()))?;
        Ok(Self { start: Instant::now(), unix_base: unix.as_nanos() as u64, lost: 0 })
    }

    /// What simulated time should be [ns].
    fn elapsed(&self) -> u64 {
        (self.start.elapsed().as_nanos() as u64).saturating_sub(self.lost)
    }

    fn fall_behind(&mut self, ns: u64) {
        self.lost += ns;
        // Logged stamps stay on the wall clock.
        self.unix_base += ns;
    }
}
