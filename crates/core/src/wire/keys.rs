//! Zenoh key expressions (design.md, Keys).

/// Downward channel of a drone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DownChannel {
    /// Plan offers.
    Plan,
    /// Plan commits.
    Commit,
    /// Commands.
    Cmd,
}

/// Upward channel of a drone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum UpChannel {
    /// Heartbeats.
    Heartbeat,
    /// Telemetry.
    Telemetry,
    /// Events.
    Event,
    /// Acknowledgements.
    Ack,
    /// Local replans.
    Replan,
}

/// Query that a drone answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Query {
    /// Its clock.
    Time,
    /// Its status.
    Status,
    /// Its committed plan's bytes.
    Plan,
}

/// `fleet/{fleet}/{drone}/down/{channel}`; `drone` may be `*`.
#[must_use]
pub fn down(fleet: &str, drone: &str, channel: DownChannel) -> String {
    let leaf = match channel {
        DownChannel::Plan => "plan",
        DownChannel::Commit => "commit",
        DownChannel::Cmd => "cmd",
    };
    format!("fleet/{fleet}/{drone}/down/{leaf}")
}

/// `fleet/{fleet}/{drone}/up/{channel}`; `drone` may be `*`.
#[must_use]
pub fn up(fleet: &str, drone: &str, channel: UpChannel) -> String {
    let leaf = match channel {
        UpChannel::Heartbeat => "heartbeat",
        UpChannel::Telemetry => "telemetry",
        UpChannel::Event => "event",
        UpChannel::Ack => "ack",
        UpChannel::Replan => "replan",
    };
    format!("fleet/{fleet}/{drone}/up/{leaf}")
}

/// `fleet/{fleet}/{drone}/{query}`.
#[must_use]
pub fn query(fleet: &str, drone: &str, query: Query) -> String {
    let leaf = match query {
        Query::Time => "time",
        Query::Status => "status",
        Query::Plan => "plan",
    };
    format!("fleet/{fleet}/{drone}/{leaf}")
}

/// Liveliness token of an agent: `fleet/{fleet}/{drone}/alive`.
#[must_use]
pub fn alive(fleet: &str, drone: &str) -> String {
    format!("fleet/{fleet}/{drone}/alive")
}

/// Whether `name` may stand in a key and a formula: a letter, then up to 31 letters, digits or `_`.
#[must_use]
pub fn is_name(name: &str) -> bool {
    let mut chars = name.chars();
    chars.next().is_some_and(|c| c.is_ascii_alphabetic())
        && name.len() <= 32
        && chars.all(|c| c.is_ascii_alphanumeric() || c == '_')
}
