//! Simulator binary: `fleet-sim run` in real time, `fleet-sim virtual` as fast as it can.
// Output on stdout is this program's interface; its errors go to stderr.
#![allow(clippy::print_stdout, clippy::print_stderr)]
#![forbid(unsafe_code)]

mod exit;
mod output;
mod realtime;
mod virtual_command;

use clap::{Parser, Subcommand};
use exit::Failure;
use fleet_sim::world::WorldConfig;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

#[derive(Parser)]
#[command(name = "fleet-sim", version, about = "Simulated quadrotors that speak MAVLink as a PX4 does")]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Real time: every vehicle listens on its UDP address until the program is stopped.
    ///
    /// Prints one JSON line when ready. Reads JSON lines on stdin: {"t0_unix_ns": N} sets mission
    /// time 0.
    Run {
        /// The world (TOML).
        #[arg(long)]
        config: PathBuf,
        /// Where the ground truth is written (MCAP).
        #[arg(long)]
        log: Option<PathBuf>,
        /// End once all vehicles have been armed and are disarmed again for 1 s.
        #[arg(long)]
        exit_when_landed: bool,
    },
    /// Virtual time: agents and vehicles in this one process, as fast as it can.
    ///
    /// Prints {"t": mission time} as it goes and {"done": true, ...} at the end. The same world and
    /// plan give the same log, byte for byte.
    Virtual {
        /// The world (TOML).
        #[arg(long)]
        config: PathBuf,
        /// The plan (X.plan.cbor).
        #[arg(long)]
        plan: PathBuf,
        /// Where everything is written (MCAP).
        #[arg(long)]
        log: Option<PathBuf>,
        /// Fly without onboard replanning, whatever the plan says.
        #[arg(long)]
        no_replan: bool,
        /// Threads that fly vehicles; as many as there are cores unless given. The log is the same.
        #[arg(long, value_parser = clap::value_parser!(u16).range(1..=1024))]
        threads: Option<u16>,
    },
}

fn main() -> ExitCode {
    tracing_subscriber::fmt()
        .with_writer(std::io::stderr)
        .with_env_filter(
            tracing_subscriber::EnvFilter::try_from_default_env()
                .unwrap_or_else(|_| tracing_subscriber::EnvFilter::new("info")),
        )
        .init();
    let outcome = match Cli::parse().command {
        Command::Run { config, log, exit_when_landed } => {
            read_config(&config).and_then(|world| realtime::run(&world, log.as_deref(), exit_when_landed))
        }
        Command::Virtual { config, plan, log, no_replan, threads } => virtual_command::use_threads(threads)
            .and_then(|()| {
                let world = read_config(&config)?;
                virtual_command::run(&world, &plan, log.as_deref(), no_replan)
            }),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("fleet-sim: {failure}");
            failure.code()
        }
    }
}

// Reading the configuration is the binary's task.
#[allow(clippy::disallowed_methods)]
fn read_config(path: &Path) -> Result<WorldConfig, Failure> {
    let text = std::fs::read_to_string(path)
        .map_err(|error| Failure::Input(format!("{}: cannot be read: {error}", path.display())))?;
    WorldConfig::parse(&text).map_err(|error| Failure::Input(format!("{}: {error}", path.display())))
}
