//! `fleet-sim virtual`: flies a plan on virtual time and reports on stdout.
// The binary reads files and measures its own speed.
#![allow(clippy::disallowed_methods)]

use crate::exit::Failure;
use crate::output::print_line;
use fleet_agent::record::{RecordError, Recorder};
use fleet_core::wire::{Plan, decode};
use fleet_sim::virtual_time::{VirtualError, VirtualFlight};
use fleet_sim::world::{End, WorldConfig};
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::Path;
use std::time::{Duration, Instant};

/// Least time between two progress lines.
const REPORT: Duration = Duration::from_millis(200);

#[derive(Serialize)]
struct Progress {
    t: f64,
}

#[derive(Serialize)]
struct Done {
    done: bool,
    sim_s: f64,
    wall_s: f64,
    end: BTreeMap<String, End>,
}

/// Sets how many threads fly vehicles, this one among them; all cores for none.
///
/// # Errors
/// When the system gives no threads.
pub fn use_threads(threads: Option<u16>) -> Result<(), Failure> {
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads.map_or(0, usize::from))
        .use_current_thread()
        .build_global()
        .map_err(|error| Failure::Environment(format!("cannot start threads: {error}")))
}

/// Flies `plan` in the world and writes the log.
///
/// # Errors
/// When plan or world are wrong, a drone refuses the plan, or the log cannot be written.
pub fn run(config: &WorldConfig, plan: &Path, log: Option<&Path>, no_replan: bool) -> Result<(), Failure> {
    let started = Instant::now();
    let bytes = std::fs::read(plan)
        .map_err(|error| Failure::Input(format!("{}: cannot be read: {error}", plan.display())))?;
    let mut plan: Plan =
        decode(&bytes).map_err(|error| Failure::Input(format!("{}: {error}", plan.display())))?;
    if no_replan {
        plan.replan.enabled = false;
    }
    let mut flight = VirtualFlight::new(config, plan)?;
    let mut recorder = log.map(Recorder::create).transpose()?;
    let mut reported = started;
    let outcome = flight.fly(recorder.as_mut(), |flight| {
        if let Some(t) = flight.mission_time().filter(|_| reported.elapsed() >= REPORT) {
            reported = Instant::now();
            print_line(&Progress { t });
        }
    });
    if let Some(recorder) = recorder {
        recorder.finish()?;
    }
    let outcome = outcome?;
    let wall_s = started.elapsed().as_secs_f64();
    print_line(&Done { done: true, sim_s: outcome.simulated, wall_s, end: outcome.end });
    Ok(())
}

impl From<VirtualError> for Failure {
    fn from(error: VirtualError) -> Self {
        match error {
            VirtualError::Record(error @ (RecordError::Create { .. } | RecordError::Write { .. })) => {
                Self::Environment(error.to_string())
            }
            error => Self::Input(error.to_string()),
        }
    }
}
