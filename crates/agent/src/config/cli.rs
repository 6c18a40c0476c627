//! Flags of the agent binary.

use super::MavlinkEndpoint;
use clap::{Args, Parser, Subcommand};
use std::path::PathBuf;
use toml::{Table, Value};

/// Flies one drone of a fleet: takes plans over Zenoh, speaks MAVLink to the autopilot.
#[derive(Clone, Debug, Default, Parser)]
#[command(name = "fleet-agent", version, args_conflicts_with_subcommands = true)]
pub struct Cli {
    /// What to do instead of flying.
    #[command(subcommand)]
    pub task: Option<Task>,
    /// Configuration file; flags win over it
    #[arg(long, value_name = "FILE.toml")]
    pub config: Option<PathBuf>,
    /// Name of the fleet [default: fleet]
    #[arg(long)]
    pub fleet: Option<String>,
    /// Id of this drone
    #[arg(long, value_name = "ID")]
    pub drone: Option<String>,
    /// Endpoint of the Zenoh router; may be given several times [default: tcp/127.0.0.1:7447]
    #[arg(long, value_name = "ENDPOINT")]
    pub zenoh: Vec<String>,
    /// udpin:ADDR:PORT listens, udpout:ADDR:PORT sends [default: udpin:127.0.0.1:14540]
    #[arg(long, value_name = "ENDPOINT")]
    pub mavlink: Option<MavlinkEndpoint>,
    /// MAVLink system id of the autopilot [default: 1]
    #[arg(long, value_name = "N")]
    pub system: Option<u8>,
    /// Write a log
    #[arg(long, value_name = "FILE.mcap")]
    pub record: Option<PathBuf>,
    /// Where committed plans are kept [default: fleet-state]
    #[arg(long, value_name = "DIR")]
    pub state_dir: Option<PathBuf>,
    /// End with exit code 0 when the drone has flown and is disarmed
    #[arg(long)]
    pub exit_when_landed: bool,
    /// End with exit code 0 when standard input is closed and the drone stays disarmed: whoever started it is gone
    #[arg(long)]
    pub exit_when_orphaned: bool,
    /// Allow addresses off this machine, although nothing is encrypted or signed
    #[arg(long)]
    pub insecure: bool,
    /// Print the effective configuration as TOML and end
    #[arg(long)]
    pub print_config: bool,
}

/// What the binary does besides flying.
#[derive(Clone, Debug, Subcommand)]
pub enum Task {
    /// Run the onboard logic again on a recorded inbox and compare what it puts out
    Replay(ReplayArgs),
}

/// Arguments of `replay`.
#[derive(Clone, Debug, Args)]
pub struct ReplayArgs {
    /// The log
    #[arg(value_name = "LOG.mcap")]
    pub log: PathBuf,
    /// Whose inbox
    #[arg(long, value_name = "ID")]
    pub drone: String,
}

impl Cli {
    /// The flags that were given, as they would stand in the file.
    #[must_use]
    pub fn overrides(&self) -> Table {
        let text = |value: &Option<String>| value.clone().map(Value::String);
        let path = |value: &Option<PathBuf>| value.as_ref().map(|p| Value::String(p.display().to_string()));
        let flag = |value: bool| value.then_some(Value::Boolean(true));
        let zenoh = (!self.zenoh.is_empty())
            .then(|| Value::Array(self.zenoh.iter().cloned().map(Value::String).collect()));
        let given = [
            ("fleet", text(&self.fleet)),
            ("drone", text(&self.drone)),
            ("zenoh", zenoh),
            ("mavlink", self.mavlink.map(|endpoint| Value::String(endpoint.to_string()))),
            ("system", self.system.map(|system| Value::Integer(system.into()))),
            ("record", path(&self.record)),
            ("state_dir", path(&self.state_dir)),
            ("exit_when_landed", flag(self.exit_when_landed)),
            ("insecure", flag(self.insecure)),
        ];
        given.into_iter().filter_map(|(key, value)| Some((key.to_owned(), value?))).collect()
    }
}
