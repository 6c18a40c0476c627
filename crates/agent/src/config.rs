//! Configuration of the agent binary: TOML file and flags; flags win.

mod cli;
mod endpoint;
#[cfg(test)]
mod tests;

pub use cli::{Cli, ReplayArgs, Task};
pub use endpoint::{MavlinkEndpoint, zenoh_host};

use crate::AgentConfig;
use fleet_core::wire::keys::is_name;
use serde::{Deserialize, Serialize, de::DeserializeOwned};
use std::path::{Path, PathBuf};
use thiserror::Error;
use toml::{Table, Value};

/// Where a configuration is wrong.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{origin}: {field}: {problem}")]
pub struct ConfigError {
    /// The file, or `command line`.
    pub origin: String,
    /// The field, with its table.
    pub field: String,
    /// What is wrong and what is legal.
    pub problem: String,
}

/// What connects the agent to the world; everything that is not the step's business.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LinkConfig {
    /// Zenoh endpoints of the router.
    pub zenoh: Vec<String>,
    /// Where the autopilot is.
    pub mavlink: MavlinkEndpoint,
    /// MAVLink system id of the autopilot; the agent sends under the same one.
    pub system: u8,
    /// Log to write.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub record: Option<PathBuf>,
    /// Where committed plans are kept.
    pub state_dir: PathBuf,
    /// End the process when the drone has flown and is disarmed.
    pub exit_when_landed: bool,
    /// Allow addresses off loopback; nothing is encrypted or signed.
    pub insecure: bool,
}

impl Default for LinkConfig {
    fn default() -> Self {
        Self {
            zenoh: vec!["tcp/127.0.0.1:7447".to_owned()],
            mavlink: MavlinkEndpoint::Listen(([127, 0, 0, 1], 14540).into()),
            system: 1,
            record: None,
            state_dir: PathBuf::from("fleet-state"),
            exit_when_landed: false,
            insecure: false,
        }
    }
}

/// The whole configuration.
#[derive(Clone, Debug, PartialEq)]
pub struct Config {
    /// Links.
    pub link: LinkConfig,
    /// The step.
    pub agent: AgentConfig,
}

const LINK_KEYS: [&str; 7] =
    ["zenoh", "mavlink", "system", "record", "state_dir", "exit_when_landed", "insecure"];
const AGENT_KEYS: [&str; 6] = ["fleet", "drone", "gains", "vehicle", "preflight", "landing"];
/// Name of a fleet that nobody named.
const DEFAULT_FLEET: &str = "fleet";

impl Config {
    /// Reads the file that `cli` names, if any, and lays the flags over it.
    ///
    /// # Errors
    /// Names the file or flag, the field, its value and what is legal.
    pub fn load(cli: &Cli) -> Result<Self, ConfigError> {
        let mut table = match &cli.config {
            Some(path) => read(path)?,
            None => Table::new(),
        };
        let file = cli.config.as_ref().map_or("command line".to_owned(), |path| path.display().to_string());
        let flags = cli.overrides();
        let origin = |field: &str| {
            let top = field.split('.').next().unwrap_or(field);
            if flags.contains_key(top) { "command line".to_owned() } else { file.clone() }
        };
        table.extend(flags.clone());
        Self::from_table(table).map_err(|(field, problem)| ConfigError {
            origin: origin(&field),
            field,
            problem,
        })
    }

    /// The effective configuration as a TOML file that [`Config::load`] reads back.
    ///
    /// # Errors
    /// When a value has no form in TOML (a path that is not Unicode).
    pub fn to_toml(&self) -> Result<String, String> {
        let mut table = Table::try_from(&self.link).map_err(|error| error.to_string())?;
        table.extend(Table::try_from(&self.agent).map_err(|error| error.to_string())?);
        toml::to_string(&table).map_err(|error| error.to_string())
    }

    fn from_table(mut table: Table) -> Result<Self, (String, String)> {
        if let Some(key) =
            table.keys().find(|k| !LINK_KEYS.contains(&k.as_str()) && !AGENT_KEYS.contains(&k.as_str()))
        {
            let legal = [&LINK_KEYS[..], &AGENT_KEYS[..]].concat().join(", ");
            return Err((key.clone(), format!("unknown field; legal are: {legal}")));
        }
        let link: Table =
            LINK_KEYS.iter().filter_map(|key| Some(((*key).to_owned(), table.remove(*key)?))).collect();
        let link: LinkConfig = whole(link)?;
        table.entry("fleet").or_insert_with(|| Value::String(DEFAULT_FLEET.to_owned()));
        if !table.contains_key("drone") {
            return Err((
                "drone".to_owned(),
                "missing; give --drone ID or drone = \"ID\" in the file".to_owned(),
            ));
        }
        let agent: AgentConfig = agent(table)?;
        let config = Self { link, agent };
        config.check()?;
        Ok(config)
    }

    fn check(&self) -> Result<(), (String, String)> {
        for (field, name) in [("fleet", &self.agent.fleet), ("drone", &self.agent.drone)] {
            if !is_name(name) {
                let legal = "a letter, then up to 31 letters, digits or _";
                return Err((field.to_owned(), format!("{name:?} is not a name; legal is {legal}")));
            }
        }
        if self.link.system == 0 {
            return Err(("system".to_owned(), "0 is not a MAVLink system id; legal are 1 to 255".to_owned()));
        }
        if self.link.zenoh.is_empty() {
            let problem = "no endpoint; legal is for example [\"tcp/127.0.0.1:7447\"]";
            return Err(("zenoh".to_owned(), problem.to_owned()));
        }
        self.check_loopback()
    }

    /// Nothing is signed or encrypted yet, so nothing leaves this machine unasked.
    fn check_loopback(&self) -> Result<(), (String, String)> {
        for endpoint in &self.link.zenoh {
            let host = zenoh_host(endpoint).map_err(|problem| ("zenoh".to_owned(), problem))?;
            let loopback = host == "localhost"
                || host.parse::<std::net::IpAddr>().is_ok_and(|address| address.is_loopback());
            if !loopback && !self.link.insecure {
                return Err(("zenoh".to_owned(), off_loopback(endpoint)));
            }
        }
        let mavlink = &self.link.mavlink;
        if !mavlink.address().ip().is_loopback() && !self.link.insecure {
            return Err(("mavlink".to_owned(), off_loopback(&mavlink.to_string())));
        }
        Ok(())
    }
}

fn off_loopback(endpoint: &str) -> String {
    format!(
        "{endpoint} is not on this machine; nothing is encrypted or signed, so only 127.0.0.1, ::1 and \
         localhost are legal without --insecure"
    )
}

// The configuration file is read once, before anything flies.
#[allow(clippy::disallowed_methods)]
fn read(path: &Path) -> Result<Table, ConfigError> {
    let error = |field: &str, problem: String| ConfigError {
        origin: path.display().to_string(),
        field: field.to_owned(),
        problem,
    };
    let text = std::fs::read_to_string(path).map_err(|e| error("file", format!("cannot be read: {e}")))?;
    text.parse::<Table>().map_err(|e| {
        let before = e.span().and_then(|span| text.get(..span.start)).unwrap_or_default();
        error(&format!("line {}", before.matches('\n').count() + 1), e.message().to_owned())
    })
}

/// Reads a table whose fields all have defaults; on failure finds the field that is to blame.
fn whole<T: DeserializeOwned>(table: Table) -> Result<T, (String, String)> {
    let error = match table.clone().try_into::<T>() {
        Ok(value) => return Ok(value),
        Err(error) => error,
    };
    for (key, value) in table {
        let alone: Table = [(key.clone(), value.clone())].into_iter().collect();
        if let Err(error) = alone.try_into::<T>() {
            return Err((key, format!("{value}: {}", error.message())));
        }
    }
    Err(("file".to_owned(), error.message().to_owned()))
}

fn agent(mut table: Table) -> Result<AgentConfig, (String, String)> {
    fn section<T: DeserializeOwned + Default>(table: &mut Table, name: &str) -> Result<T, (String, String)> {
        match table.remove(name) {
            None => Ok(T::default()),
            Some(Value::Table(inner)) => {
                whole(inner).map_err(|(field, problem)| (format!("{name}.{field}"), problem))
            }
            Some(other) => Err((name.to_owned(), format!("{other} is not a table; legal is [{name}]"))),
        }
    }
    fn name(table: &mut Table, key: &str) -> Result<String, (String, String)> {
        match table.remove(key) {
            Some(Value::String(text)) => Ok(text),
            other => {
                Err((key.to_owned(), format!("{} is not a string", other.unwrap_or(Value::Boolean(false)))))
            }
        }
    }
    Ok(AgentConfig {
        fleet: name(&mut table, "fleet")?,
        drone: name(&mut table, "drone")?,
        gains: section(&mut table, "gains")?,
        vehicle: section(&mut table, "vehicle")?,
        preflight: section(&mut table, "preflight")?,
        landing: section(&mut table, "landing")?,
    })
}
