//! Agent binary: reads the configuration, starts the threads, flies.
#![forbid(unsafe_code)]

use clap::Parser;
use fleet_agent::config::{Cli, Config, LinkConfig, ReplayArgs, Task};
use fleet_agent::mavlink::Codec;
use fleet_agent::record::replay;
use fleet_agent::runtime::clock::Clock;
use fleet_agent::runtime::comms::Comms;
use fleet_agent::runtime::control::{Control, Exit, Outboxes};
use fleet_agent::runtime::plans::Plans;
use fleet_agent::runtime::queue::Queue;
use fleet_agent::runtime::vehicle_link::VehicleLink;
use fleet_agent::runtime::{RuntimeError, Wake, persist, recording, worker};
use fleet_agent::{Agent, AgentConfig};
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::iterator::Signals;
use std::io::Write;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

const OK: u8 = 0;
const DIFFERENT: u8 = 1;
const BAD_INPUT: u8 = 2;
const ENVIRONMENT: u8 = 4;
const INTERRUPTED: u8 = 130;

/// Steps in the wake queue: a flood beyond it is dropped, not buffered.
const WAKE_CAPACITY: usize = 4096;
/// Messages that may wait for Zenoh: about a minute of heartbeats and telemetry.
const COMMS_CAPACITY: usize = 1024;
/// Jobs that may wait for solver or disk.
const JOB_CAPACITY: usize = 16;
/// Closing Zenoh may not delay the end longer than this.
const COMMS_END: Duration = Duration::from_secs(1);
/// Flushing the log may not either.
const RECORD_END: Duration = Duration::from_secs(10);

fn main() -> ExitCode {
    tracing_subscriber::fmt()
        .with_env_filter(
            tracing_subscriber::EnvFilter::try_from_default_env().unwrap_or_else(|_| {
                tracing_subscriber::EnvFilter::new("info,zenoh=error,zenoh_transport=error")
            }),
        )
        .with_writer(std::io::stderr)
        .with_ansi(false)
        .init();
    let cli = Cli::parse();
    let code = match &cli.task {
        Some(Task::Replay(arguments)) => replay_log(arguments),
        None => match Config::load(&cli) {
            Err(error) => failed(BAD_INPUT, &error),
            Ok(config) if cli.print_config => print_config(&config),
            Ok(config) => {
                fly(config, cli.exit_when_orphaned).unwrap_or_else(|error| failed(ENVIRONMENT, &error))
            }
        },
    };
    ExitCode::from(code)
}

// A user's mistake is answered on stderr, without the log's decoration.
#[allow(clippy::print_stderr)]
fn failed(code: u8, error: &dyn std::fmt::Display) -> u8 {
    eprintln!("fleet-agent: {error}");
    code
}

fn say(line: &str) -> u8 {
    let mut out = std::io::stdout();
    match writeln!(out, "{line}").and_then(|()| out.flush()) {
        Ok(()) => OK,
        Err(error) => failed(ENVIRONMENT, &format!("stdout: {error}")),
    }
}

fn print_config(config: &Config) -> u8 {
    match config.to_toml() {
        Ok(text) => say(text.trim_end()),
        Err(error) => failed(BAD_INPUT, &error),
    }
}

fn replay_log(arguments: &ReplayArgs) -> u8 {
    match replay(&arguments.log, &arguments.drone) {
        Err(error) => failed(BAD_INPUT, &error),
        Ok(replay) => {
            let difference =
                replay.first_difference.map(|(step, now)| serde_json::json!({"step": step, "now_ns": now.0}));
            let equal = difference.is_none();
            let line = serde_json::json!({
                "equal": equal, "steps": replay.steps, "first_difference": difference,
            });
            match say(&line.to_string()) {
                OK if !equal => DIFFERENT,
                code => code,
            }
        }
    }
}

fn fly(config: Config, exit_when_orphaned: bool) -> Result<u8, RuntimeError> {
    let Config { link: settings, agent } = config;
    if settings.insecure {
        tracing::warn!("--insecure: whoever reaches these addresses can command this drone");
    }
    let clock = Clock::start();
    let (wake, woken) = Queue::bounded("wake", WAKE_CAPACITY);
    let stop = Arc::new(AtomicBool::new(false));
    let link = VehicleLink::open(settings.mavlink)?;
    let address = link.local_address()?;
    handle_signals(wake.clone())?;
    if exit_when_orphaned {
        watch_stdin(wake.clone())?;
    }
    let reader = link.read(wake.clone(), Arc::clone(&stop))?;
    let (outboxes, threads) = start_threads(&settings, &agent, clock, &wake)?;
    let codec = Codec::new(settings.system, settings.system);
    let drone = agent.drone.clone();
    let mut control = Control::new(Agent::new(agent), codec, clock, link, outboxes);
    let ready = serde_json::json!({"ready": true, "drone": drone, "mavlink": address.to_string()});
    if say(&ready.to_string()) != OK {
        return Ok(ENVIRONMENT);
    }
    let exit = control.run(&woken, settings.exit_when_landed);
    tracing::info!(?exit, "ending");
    stop.store(true, Ordering::Relaxed);
    // Dropping the queues ends the threads behind them.
    drop(control);
    threads.finish(clock);
    drop(reader);
    Ok(match exit {
        Exit::Signal | Exit::Landed | Exit::Orphaned => OK,
        Exit::Forced => INTERRUPTED,
    })
}

struct Threads {
    comms: JoinHandle<()>,
    open: Arc<AtomicBool>,
    record: Option<JoinHandle<()>>,
}

impl Threads {
    fn finish(self, clock: Clock) {
        if let Some(record) = self.record {
            wait(&record, "log", RECORD_END, clock);
        }
        // A thread that still looks for its router has nothing to close.
        if self.open.load(Ordering::Relaxed) {
            wait(&self.comms, "Zenoh", COMMS_END, clock);
        }
    }
}

// The process is ending; nothing flies on this thread any more.
#[allow(clippy::disallowed_methods)]
fn wait(thread: &JoinHandle<()>, what: &str, at_most: Duration, clock: Clock) {
    let end = clock.now().plus(at_most.as_secs_f64());
    while !thread.is_finished() {
        if clock.until(end).is_zero() {
            tracing::warn!(what, "did not end in time");
            return;
        }
        std::thread::sleep(Duration::from_millis(5));
    }
}

fn start_threads(
    settings: &LinkConfig,
    agent: &AgentConfig,
    clock: Clock,
    wake: &Queue<Wake>,
) -> Result<(Outboxes, Threads), RuntimeError> {
    let record = match &settings.record {
        Some(path) => Some(recording::start(path, agent, clock)?),
        None => None,
    };
    let (record, record_thread) = record.unzip();
    let plans = Plans::default();
    let open = Arc::default();
    let (comms, outgoing) = Queue::bounded("comms", COMMS_CAPACITY);
    let comms_thread = Comms {
        fleet: agent.fleet.clone(),
        drone: agent.drone.clone(),
        endpoints: settings.zenoh.clone(),
        clock,
        plans: plans.clone(),
        wake: wake.clone(),
        open: Arc::clone(&open),
    }
    .start(outgoing)?;
    let (solver, jobs) = Queue::bounded("solver", JOB_CAPACITY);
    let (drone, committed, answers) = (agent.drone.clone(), plans.clone(), wake.clone());
    thread("solver", move || worker::run(&drone, &committed, &jobs, &answers))?;
    let (disk, jobs) = Queue::bounded("disk", JOB_CAPACITY);
    let (directory, answers) = (settings.state_dir.join(&agent.drone), wake.clone());
    thread("disk", move || persist::run(&directory, &plans, &jobs, &answers))?;
    let outboxes = Outboxes { comms, solver, disk, record };
    Ok((outboxes, Threads { comms: comms_thread, open, record: record_thread }))
}

fn handle_signals(wake: Queue<Wake>) -> Result<(), RuntimeError> {
    let mut signals = Signals::new([SIGINT, SIGTERM]).map_err(RuntimeError::Signals)?;
    thread("signals", move || {
        for _ in signals.forever() {
            let _ = wake.offer(Wake::Signal);
        }
    })?;
    Ok(())
}

/// Standard input is a pipe that only the starting process holds: its end tells that this process is gone.
fn watch_stdin(wake: Queue<Wake>) -> Result<(), RuntimeError> {
    thread("stdin", move || {
        // Whatever is written there is not for the agent; an error is an end as well.
        let _ = std::io::copy(&mut std::io::stdin().lock(), &mut std::io::sink());
        let _ = wake.offer(Wake::Orphaned);
    })
}

fn thread(name: &'static str, body: impl FnOnce() + Send + 'static) -> Result<(), RuntimeError> {
    fleet_agent::runtime::spawn(name, body).map(drop)
}
